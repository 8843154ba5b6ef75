//! What a configuration file may say, and what an operator is told who has written something else.

use proptest::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// How the lamp stands.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
struct Lamp {
    /// The beam.
    beam: Beam,
    /// What it is called. Default none.
    name: Option<String>,
    /// Where it stands, metres. Default the origin.
    place_m: [f64; 2],
    /// Bulbs. Default 3.
    bulbs: usize,
    /// Offset. Default -0.5.
    offset: f32,
    /// What it looks like.
    colour: Colour,
    /// When it goes out.
    ending: Ending,
    /// Pictures of it. Default none.
    pictures: Vec<PathBuf>,
    /// Not a file's business.
    #[serde(skip)]
    uses: usize,
}

impl Default for Lamp {
    fn default() -> Self {
        Self {
            beam: Beam { reach_m: 7.0, ..Beam::default() },
            name: None,
            place_m: [0.0; 2],
            bulbs: 3,
            offset: -0.1,
            colour: Colour::WarmWhite,
            ending: Ending::After(2),
            pictures: Vec::new(),
            uses: 0,
        }
    }
}

/// Light.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
struct Beam {
    /// How far it reaches, metres. Default 3.
    reach_m: f64,
    /// Side of a cell, metres. Default 0.05.
    #[schemars(range(min = 0.01, max = 1.0))]
    resolution_m: f64,
    /// Whether it is on. Default true.
    is_on: bool,
}

impl Default for Beam {
    fn default() -> Self {
        Self { reach_m: 3.0, resolution_m: 0.05, is_on: true }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
enum Colour {
    /// As at home.
    WarmWhite,
    /// As in an office.
    Cold,
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
enum Ending {
    Never,
    After(u32),
}

/// A section whose keys stand in two structures.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
struct Desk {
    /// Default 0.
    drawers: usize,
    /// Its light.
    #[serde(flatten)]
    lamp: Lamp,
}

#[test]
fn a_section_can_have_its_keys_from_two_structures() {
    let parse =
        |text: &str| fht_program::parse::<Desk>(text, Path::new("desk.toml")).map_err(|error| error.to_string());
    let desk = parse("drawers = 3\nbulbs = 4\nbeam.is_on = false").unwrap();
    assert_eq!((desk.drawers, desk.lamp.bulbs, desk.lamp.beam.is_on), (3, 4, false));
    assert_eq!(parse("bulb = 4").unwrap_err(), "desk.toml:1: bulb is not known; did you mean bulbs?");
    let text = fht_program::print(&desk).unwrap();
    assert!(text.contains("# Bulbs. Default 3.\nbulbs = 4\n"), "{text}");
    assert_eq!(parse(&text).unwrap(), desk);
}

fn parse(text: &str) -> Result<Lamp, String> {
    fht_program::parse(text, Path::new("lamp.toml")).map_err(|error| error.to_string())
}

#[test]
fn what_the_file_leaves_out_keeps_the_default_of_its_place() {
    let lamp = parse("name = 'hall'\ncolour = 'cold'\nending = 'never'\n[beam]\nis_on = false\n").unwrap();
    assert_eq!((lamp.name.as_deref(), lamp.colour, lamp.ending), (Some("hall"), Colour::Cold, Ending::Never));
    // The beam's own default is 3; the lamp's is 7.
    assert_eq!(lamp.beam, Beam { reach_m: 7.0, resolution_m: 0.05, is_on: false });
    assert_eq!(parse("").unwrap(), Lamp::default());
    assert_eq!(parse("beam.reach_m = 4\nending = { after = 9 }").unwrap().ending, Ending::After(9));
    // Sections of other programs are theirs.
    assert_eq!(parse("[server]\nanything = 1").unwrap(), Lamp::default());
}

#[test]
fn the_printed_file_says_what_every_key_means() {
    let text = fht_program::print(&Lamp::default()).unwrap();
    for line in [
        "# How the lamp stands.",
        "# What it is called. Default none.\n# name = \"\"",
        "offset = -0.1",
        "colour = \"warm_white\"",
        "ending = { after = 2 }",
        "# The beam.\n[beam]",
        "# From 0.01 to 1.\nresolution_m = 0.05",
    ] {
        assert!(text.contains(line), "{line} is not in\n{text}");
    }
    assert!(!text.contains("uses"), "{text}");
    assert_eq!(parse(&text).unwrap(), Lamp::default(), "{text}");
}

#[test]
fn whoever_errs_is_told_where_and_what_was_meant() {
    for (text, expected) in [
        ("\nnmae = 'x'", "lamp.toml:2: nmae is not known; did you mean name?"),
        ("[beam]\nreach = 1", "lamp.toml:2: beam.reach is not known; did you mean beam.reach_m?"),
        // In the wrong section.
        ("resolution_m = 1", "lamp.toml:1: resolution_m is not known; did you mean beam.resolution_m?"),
        ("[bean]\nis_on = true", "lamp.toml:1: bean is not known; did you mean beam?"),
        ("bulbs = 'many'", "lamp.toml:1: bulbs is the text \"many\"; it must be a whole number"),
        ("bulbs = 1.5", "lamp.toml:1: bulbs is 1.5; it must be a whole number"),
        ("bulbs = -1", "lamp.toml:1: bulbs is -1; it must be from 0 to 3000 (default 3)"),
        ("bulbs = 99999999999999999999", "lamp.toml:1: bulbs is 99999999999999999999, which is too great"),
        ("beam = 1", "lamp.toml:1: beam is 1; it must be a section"),
        ("[name]\nx = 1", "lamp.toml:1: name is a section; it must be a text in quotes"),
        ("[beam]\nis_on = 1", "lamp.toml:2: beam.is_on is 1; it must be true or false"),
        ("[beam]\nreach_m = nan", "lamp.toml:2: beam.reach_m must be a finite number"),
        ("[beam]\nreach_m = 1e9", "lamp.toml:2: beam.reach_m is 1000000000; it must be from 0 to 7000 (default 7)"),
        ("[beam]\nresolution_m = 0.0", "lamp.toml:2: beam.resolution_m is 0; it must be from 0.01 to 1 (default 0.05)"),
        ("colour = 'blue'", "lamp.toml:1: colour is \"blue\"; it must be one of \"warm_white\", \"cold\""),
        ("place_m = [1.0]", "lamp.toml:1: place_m has 1 entries; it must have 2"),
        ("place_m = [1.0, 'x']", "lamp.toml:1: place_m is the text \"x\"; it must be a number"),
        ("ending = 'soon'", "lamp.toml:1: ending is refused: unknown variant `soon`"),
        ("[beam]\nresolution = 3", "lamp.toml:2: beam.resolution is not known; did you mean beam.resolution_m?"),
        ("uses = 3", "lamp.toml:1: uses is not known; did you mean"),
        (
            "zwxq = 3",
            "lamp.toml:1: zwxq is not known; there is: beam, bulbs, colour, ending, name, offset, pictures, place_m",
        ),
        ("name = 1979-05-27", "lamp.toml:1: name is the date 1979-05-27; it must be a text in quotes"),
        ("name = ", "lamp.toml:1: "),
    ] {
        let error = parse(text).unwrap_err();
        assert!(error.starts_with(expected), "{text}\n{error}\n{expected}");
    }
    // All at once.
    assert_eq!(parse("nmae = 1\nbulbs = true\n").unwrap_err().lines().count(), 2);
    let missing = fht_program::load::<Lamp>(Path::new("nowhere/lamp.toml")).unwrap_err().to_string();
    assert!(missing.starts_with("nowhere/lamp.toml: the configuration cannot be read: No such file"), "{missing}");
}

fn lamps() -> impl Strategy<Value = Lamp> {
    let beam = (0.0..7000.0, 0.01..1.0, any::<bool>());
    let beam = beam.prop_map(|(reach_m, resolution_m, is_on)| Beam { reach_m, resolution_m, is_on });
    let shape = (prop::option::of("\\PC*"), [0.0..1e5, 0.0..1e5], 0_usize..3000, -100.0_f32..0.0);
    let look = (prop::bool::ANY, prop::option::of(0_u32..=2000), prop::collection::vec("\\PC*", 0..3));
    (beam, shape, look).prop_map(|(beam, (name, place_m, bulbs, offset), (warm, after, pictures))| Lamp {
        beam,
        name,
        place_m,
        bulbs,
        offset,
        colour: if warm { Colour::WarmWhite } else { Colour::Cold },
        ending: after.map_or(Ending::Never, Ending::After),
        pictures: pictures.into_iter().map(PathBuf::from).collect(),
        uses: 0,
    })
}

proptest! {
    #[test]
    fn what_is_printed_loads_to_the_same(lamp in lamps()) {
        let text = fht_program::print(&lamp).unwrap();
        prop_assert_eq!(parse(&text).map_err(TestCaseError::fail)?, lamp);
    }

    #[test]
    fn no_file_makes_it_panic(text in "[a-z_\\[\\]{}=\\. 0-9\"'\n-]{0,80}") {
        let _ = parse(&text);
    }
}
