//! SDF: the visuals of a world with their poses.
//!
//! Physics, lights, sensors, plugins and collision shapes are ignored: a robot here meets what is
//! visible.

mod element;
mod frames;
mod material;
mod shape;

pub(crate) use material::GREY;
pub(crate) use shape::Shape;

use super::mesh::Paint;
use super::report::{Flaw, ImportReport};
use super::resolve::Paths;
use element::{child, name_of};
use frames::{Frames, own_pose};
use nalgebra::Isometry3;
use roxmltree::{Document, Node, ParsingOptions};
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Largest file that is read, bytes.
const MOST_BYTES: u64 = 64 << 20;
/// Deepest nesting of models.
const MOST_DEPTH: usize = 16;
/// Most models and visuals of a world.
const MOST_ELEMENTS: usize = 100_000;
/// Level planes of at least this size, not above the robot's floor, are treated as endless ground,
/// metres.
const GROUND_SIZE_M: f64 = 10.0;
/// Tolerance for level ground at the height of the floor, metres.
const GROUND_TOLERANCE_M: f64 = 1e-3;
/// Colour of Gazebo's own ground plane.
const GROUND_COLOUR: [f32; 3] = [0.62, 0.62, 0.60];

/// Why a world's file cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum SdfError {
    /// The file cannot be read.
    #[error("{0}")]
    Read(#[from] std::io::Error),
    /// The file is too large for a world.
    #[error("a file of {0} bytes is too large")]
    Large(u64),
    /// The XML is malformed.
    #[error("malformed XML: {0}")]
    Xml(#[from] roxmltree::Error),
    /// The root element is not `<sdf>`.
    #[error("no SDF: the root is <{0}>")]
    Root(String),
    /// Something is where nothing of a map may be.
    #[error("{0}, where nothing of a map may be: shift the world to the origin")]
    Remote(String),
    /// Nothing is left of the world without what cannot be found or read.
    #[error("no floor between walls is left of it: {flaws} (looked for in {folders})")]
    Nothing {
        /// What is missing, and what else is wrong.
        flaws: String,
        /// Where models are looked for.
        folders: String,
    },
}

/// A shape in the world.
#[derive(Clone, Debug)]
pub(crate) struct Placed {
    /// Where.
    pub(crate) world_from_visual: Isometry3<f64>,
    /// What.
    pub(crate) shape: Shape,
    /// Its paint, if the visual itself gives one.
    pub(crate) paint: Option<Paint>,
    /// The folder that relative paths refer to.
    pub(crate) base: Arc<Path>,
    /// Which model of the world it belongs to.
    pub(crate) model: usize,
}

/// What a world shows.
#[derive(Debug)]
pub(crate) struct SdfDescription {
    /// Everything but the ground.
    pub(crate) placed: Vec<Placed>,
    /// Height (metres) and colour of the endless ground.
    pub(crate) ground: Option<(f64, [f32; 3])>,
    /// Colour behind everything.
    pub(crate) sky: [f32; 3],
}

/// Reads a world, or a model on its own.
pub(crate) fn read(path: &Path, paths: &Paths, report: &mut ImportReport) -> Result<SdfDescription, SdfError> {
    let text = text(path)?;
    let document = parse(&text)?;
    let root = document.root_element();
    if root.tag_name().name() != "sdf" {
        return Err(SdfError::Root(root.tag_name().name().to_owned()));
    }
    let world = child(root, "world").unwrap_or(root);
    let background = child(world, "scene").and_then(|scene| child(scene, "background"));
    let mut reader = Reader {
        paths,
        report,
        texts: HashMap::new(),
        chain: Vec::new(),
        elements: 0,
        models: 0,
        description: SdfDescription {
            placed: Vec::new(),
            ground: None,
            sky: background.and_then(material::colour).unwrap_or(GREY),
        },
    };
    reader.world(world, &folder_of(path));
    Ok(reader.description)
}

fn text(path: &Path) -> Result<String, SdfError> {
    let bytes = std::fs::metadata(path)?.len();
    if bytes > MOST_BYTES {
        return Err(SdfError::Large(bytes));
    }
    Ok(String::from_utf8_lossy(&std::fs::read(path)?).into_owned())
}

fn parse(text: &str) -> Result<Document<'_>, roxmltree::Error> {
    Document::parse_with_options(text, ParsingOptions { allow_dtd: true, ..ParsingOptions::default() })
}

fn folder_of(path: &Path) -> Arc<Path> {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or_else(|| Path::new(".")).into()
}

struct Reader<'a> {
    paths: &'a Paths,
    report: &'a mut ImportReport,
    texts: HashMap<PathBuf, Arc<str>>,
    /// The files being read, each included by the one before.
    chain: Vec<PathBuf>,
    elements: usize,
    /// Models of the world so far.
    models: usize,
    description: SdfDescription,
}

impl Reader<'_> {
    fn world<'d>(&mut self, world: Node<'d, 'd>, base: &Arc<Path>) {
        let states = self.states(world);
        let frames = Frames::of(world);
        for element in world.children().filter(Node::is_element) {
            let name = element.attribute("name").or_else(|| child(element, "name")?.text().map(str::trim));
            let state = name.and_then(|name| states.get(name).copied());
            self.models += 1;
            match element.tag_name().name() {
                "model" => {
                    let pose = state.unwrap_or_else(|| frames.pose(element, self.report));
                    self.model(element, &pose, base, 0);
                }
                "include" => self.include(element, &frames, state, &Isometry3::identity(), base, 0),
                kind @ ("actor" | "population" | "road") => {
                    self.report.note(Flaw::Element, format!("{kind} {}", name_of(element)));
                }
                _ => {}
            }
        }
    }

    /// The poses of models in the world's `<state>`.
    fn states<'d>(&mut self, world: Node<'d, 'd>) -> HashMap<&'d str, Isometry3<f64>> {
        let Some(state) = child(world, "state") else { return HashMap::new() };
        let models = state.children().filter(|node| node.has_tag_name("model"));
        models.filter_map(|model| Some((model.attribute("name")?, own_pose(model, self.report)?))).collect()
    }

    /// Counts a model or visual; `false` if there are too many.
    fn count(&mut self) -> bool {
        self.elements += 1;
        if self.elements == MOST_ELEMENTS {
            self.report.note(Flaw::Extent, format!("models and visuals after the first {MOST_ELEMENTS}"));
        }
        self.elements < MOST_ELEMENTS
    }

    fn model<'d>(&mut self, model: Node<'d, 'd>, pose: &Isometry3<f64>, base: &Arc<Path>, depth: usize) {
        if depth > MOST_DEPTH {
            self.report.note(Flaw::Nesting, name_of(model));
            return;
        }
        if !self.count() {
            return;
        }
        let frames = Frames::of(model);
        for element in model.children().filter(Node::is_element) {
            match element.tag_name().name() {
                "link" => {
                    let link = frames.pose(element, self.report);
                    for visual in element.children().filter(|node| node.has_tag_name("visual")) {
                        let in_model = frames.pose_in_link(visual, &link, self.report);
                        self.visual(visual, pose * in_model, base);
                    }
                }
                "model" => {
                    let nested = pose * frames.pose(element, self.report);
                    self.model(element, &nested, base, depth + 1);
                }
                "include" => self.include(element, &frames, None, pose, base, depth + 1),
                _ => {}
            }
        }
    }

    /// Reads the model that an include names. Its pose is the include's, or else its own.
    fn include<'d>(
        &mut self,
        include: Node<'d, 'd>,
        frames: &Frames<'d>,
        state: Option<Isometry3<f64>>,
        parent: &Isometry3<f64>,
        base: &Arc<Path>,
        depth: usize,
    ) {
        let uri = child(include, "uri").and_then(|node| node.text()).unwrap_or_default().trim();
        let stated = child(include, "pose").is_some().then(|| frames.pose(include, self.report));
        let given = state.or(stated);
        let Some(path) = self.paths.find_model(uri, base) else {
            self.builtin(uri, &(parent * given.unwrap_or_else(Isometry3::identity)));
            return;
        };
        if self.chain.contains(&path) || depth > MOST_DEPTH {
            self.report.note(Flaw::Nesting, uri);
            return;
        }
        if !self.count() {
            return;
        }
        let text = match self.texts.get(&path) {
            Some(text) => Arc::clone(text),
            None => match text(&path) {
                Ok(text) => Arc::clone(self.texts.entry(path.clone()).or_insert_with(|| text.into())),
                Err(error) => {
                    self.report.note(Flaw::ModelFile, format!("{uri} ({error})"));
                    return;
                }
            },
        };
        let document = match parse(&text) {
            Ok(document) => document,
            Err(error) => {
                self.report.note(Flaw::ModelFile, format!("{uri} ({error})"));
                return;
            }
        };
        let root = document.root_element();
        let models: Vec<_> = root.children().filter(|node| node.has_tag_name("model")).collect();
        if models.is_empty() && !root.children().any(|node| node.has_tag_name("light")) {
            self.report.note(Flaw::ModelFile, format!("{uri} (no model in it)"));
        }
        let base = folder_of(&path);
        self.chain.push(path);
        for model in models {
            let own = given.unwrap_or_else(|| Frames::default().pose(model, self.report));
            self.model(model, &(parent * own), &base, depth);
        }
        self.chain.pop();
    }

    /// The models that come with Gazebo.
    fn builtin(&mut self, uri: &str, pose: &Isometry3<f64>) {
        match uri.trim_end_matches('/').rsplit('/').next() {
            Some("sun" | "Sun") => {}
            Some("ground_plane" | "Ground Plane" | "asphalt_plane") => {
                self.ground(pose.translation.z, GROUND_COLOUR);
            }
            _ => self.report.note(Flaw::Model, uri),
        }
    }

    /// Of several grounds the highest is visible. The robots' floor is at height 0: ground cannot
    /// be above it.
    fn ground(&mut self, height_m: f64, colour: [f32; 3]) {
        let height_m = height_m.min(0.0);
        if self.description.ground.is_none_or(|(highest_m, _)| height_m > highest_m) {
            self.description.ground = Some((height_m, colour));
        }
    }

    fn visual<'d>(&mut self, visual: Node<'d, 'd>, world_from_visual: Isometry3<f64>, base: &Arc<Path>) {
        if !self.count() {
            return;
        }
        let name = name_of(visual);
        let Some(geometry) = child(visual, "geometry") else {
            self.report.note(Flaw::Shape, format!("no geometry of {name}"));
            return;
        };
        let Some(shape) = shape::read(geometry, &name, self.report) else { return };
        let paint = material::paint(visual, self.report);
        if let Shape::Plane { normal, size } = &shape {
            let height_m = world_from_visual.translation.z;
            let up = world_from_visual.rotation * normal;
            let is_level = up.z > 1.0 - GROUND_TOLERANCE_M && height_m <= GROUND_TOLERANCE_M;
            if is_level && size.iter().all(|&size| size >= GROUND_SIZE_M) {
                self.ground(height_m, paint.map_or(GROUND_COLOUR, |paint| paint.colour));
                return;
            }
        }
        self.description.placed.push(Placed {
            world_from_visual,
            shape,
            paint,
            base: Arc::clone(base),
            model: self.models,
        });
    }
}
