//! A map that others write, too: joining it, following what they write, and dividing the work.

use super::others::{Known, Newcomer, Others};
use super::{Mapper, MapperConfig, match_threshold};
use crate::construct::{PlaceObservation, point};
use crate::explore::{SeenSquares, Teammate, seen_area};
use crate::slam::{Anchored, Slam, Told, ToldNode, Tracking};
use crate::team::Joining;
use fht_client::PoseReport;
use fht_descriptor::{Appearance, DescriptorNet};
use fht_map::{MapState, Rules};
use fht_perception::frame::SensorFrame;
use fht_perception::pose::{Point2, Pose2, from_fixed, to_fixed};
use fht_proto::api::fleet::{ExplorerGoal, LocalizationState};
use fht_proto::{AuthorId, Descriptor, NodeId, NodeKind, SeenArea};
use fht_worker::{Pace, Taking};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Frames after a change of the map at which its walls are used by a robot that looks for its
/// place.
const WALLS_AFTER_FRAMES: u32 = 2;
/// Squares that others may tell of in all.
const MOST_SQUARES: usize = 16_000_000;
/// Way between places that a newcomer remembers, metres.
const REMEMBER_EVERY_M: f64 = 0.5;

impl Mapper {
    /// Before the first frame of a robot that is to join a map. It explores at once, and writes
    /// when it has found its place. `eyes` are a network of its own to find it with.
    ///
    /// # Errors
    /// When the system gives no thread.
    pub fn joining(
        config: MapperConfig,
        author: AuthorId,
        net: Option<DescriptorNet>,
        eyes: Option<DescriptorNet>,
    ) -> std::io::Result<Self> {
        let taking = match config.pace {
            Pace::Repeatable => Taking::AfterFrames(WALLS_AFTER_FRAMES),
            Pace::RealTime => Taking::WhenThere,
        };
        let joining = Joining::new(config.join.clone(), taking);
        let slam = Slam::unplaced(config.slam.clone(), config.pace)?;
        let newcomer = Some(Newcomer { joining, eyes, shared: None, remembered: None });
        Ok(Self { slam, newcomer, ..Self::new(config, author, net)? })
    }

    /// Says what the clock on the wall showed when the run began, microseconds since 1970: see
    /// [`Journal::set_began`](crate::publish::Journal::set_began).
    pub fn set_began(&mut self, wall_us: u64) {
        self.journal.set_began(wall_us);
    }

    /// From now on others may write the map, too, and what they write is given by
    /// [`take_shared_map`](Self::take_shared_map). It is `shared` now, and has no nodes; `stored`
    /// are the increments of earlier runs of this robot.
    pub fn share(&mut self, shared: &MapState, stored: u64) {
        self.journal.resume(shared, stored);
    }

    /// Whether the robot knows where in the map it is: from the first frame on, unless it is to
    /// join one.
    #[must_use]
    pub fn is_placed(&self) -> bool {
        self.newcomer.is_none()
    }

    /// Whether there is anything to say of where the robot is: a robot that begins a map has
    /// nothing to say before its first frame.
    #[must_use]
    pub fn has_whereabouts(&self) -> bool {
        self.latest.is_some() || !self.is_placed()
    }

    /// What the robot says of where it is.
    #[must_use]
    pub fn whereabouts(&self) -> PoseReport {
        match (&self.newcomer, &self.latest) {
            (Some(newcomer), _) => PoseReport {
                // It is not localized before it has joined.
                state: match newcomer.joining.state() {
                    LocalizationState::Localized => LocalizationState::Candidates,
                    state => state,
                },
                confidence: newcomer.joining.confidence(),
                candidates: newcomer.joining.candidates(),
                ..PoseReport::default()
            },
            (None, Some(latest)) if latest.tracking != Tracking::Lost => PoseReport {
                state: LocalizationState::Localized,
                confidence: 1.0,
                map_from_base: Some(latest.map_from_base),
                ..PoseReport::default()
            },
            (None, None) => PoseReport::default(),
            (None, Some(_)) => PoseReport {
                state: LocalizationState::Lost,
                lost_because: Some("what it sees contradicts the map that it writes".to_owned()),
                ..PoseReport::default()
            },
        }
    }

    /// What the robot is about, for others to go elsewhere; nothing before it knows where in the
    /// map it is.
    #[must_use]
    pub fn goal(&self) -> Option<ExplorerGoal> {
        let at = self.whereabouts().map_from_base?.translation;
        Some(ExplorerGoal {
            at: [at.x, at.y],
            target: self.explorer.goal().map(|target| [target.x, target.y]),
            remaining_m: self.explorer.remaining_m(),
            finished: self.explorer.is_complete(),
            finishing: false,
        })
    }

    /// The number of the newest increment that this robot has written, those of earlier runs
    /// included.
    #[must_use]
    pub fn written(&self) -> u64 {
        self.journal.written()
    }

    /// What the robot has seen, for others; nothing before it knows where in the map it is.
    #[must_use]
    pub fn seen(&self) -> Option<SeenArea> {
        self.is_placed().then(|| seen_area(self.grid(), self.journal.author(), self.journal.written())).flatten()
    }

    /// The other explorers that are there, and what they are about.
    pub fn set_teammates(&mut self, mates: Vec<Teammate>) {
        self.others.team.mates = mates;
        self.tell_explorer();
    }

    /// What holds on the map from now on: what operators wrote, and what other robots found
    /// blocked. The robot keeps to it once it knows where in the map it is.
    pub fn set_rules(&mut self, rules: Arc<Rules>) {
        self.others.rules = rules;
        self.bind_explorer();
    }

    /// Places of the map mean nothing to an explorer that is in a frame of its own.
    fn bind_explorer(&mut self) {
        if self.is_placed() {
            self.explorer.set_rules(Arc::clone(&self.others.rules));
        }
    }

    /// What others say is of use once this robot knows where in the map it is.
    fn tell_explorer(&mut self) {
        if self.is_placed() {
            self.explorer.set_team(self.others.team.clone());
        }
    }

    /// What other explorers have seen: by author, the newest word of each whose increments are here
    /// that it had written by then. The word of one that died is not to be given: it may have seen
    /// what it made no nodes of.
    pub fn take_seen_areas(&mut self, areas: &[SeenArea]) {
        let resolution_m = self.grid().resolution_m();
        let areas = if self.config.join.looks_again { &[] } else { areas };
        // Each is read on the robot's loop: names are free to invent.
        let mut squares_left = MOST_SQUARES;
        let is_affordable = |area: &&SeenArea| {
            let count = usize::from(area.width) * area.height();
            let is_affordable = count <= squares_left;
            squares_left -= if is_affordable { count } else { 0 };
            is_affordable
        };
        let squares = areas.iter().filter(is_affordable).filter_map(|area| SeenSquares::new(area, resolution_m));
        self.others.team.seen = squares.map(Arc::new).collect();
        self.tell_explorer();
    }

    /// The map is `shared` now, of which the server has this robot's increments up to number
    /// `acknowledged`.
    pub fn take_shared_map(&mut self, shared: &MapState, acknowledged: u64) {
        if let Some(newcomer) = &mut self.newcomer {
            newcomer.joining.follow(shared);
            newcomer.shared = Some((shared.clone(), acknowledged));
            return;
        }
        self.journal.follow(shared, acknowledged);
        let is_shown = !self.config.join.looks_again;
        let news = self.others.news(self.journal.state(), |id| self.builder.is_own(id), is_shown);
        if news.is_empty() {
            return;
        }
        for (id, node) in &news {
            let position = node.as_ref().filter(|node| node.scan.is_some());
            self.builder.take_foreign_node(*id, position.map(|node| to_fixed(&node.map_from_node).position));
        }
        self.slam.take_foreign_nodes(news);
        self.tell_explorer();
    }

    /// Whether the robot stands and waits for another one to begin the map.
    pub(super) fn is_waiting(&self, time_us: u64) -> bool {
        let wait_us = self.began_us.saturating_add((self.config.join.wait_s.max(0.0) * 1e6) as u64);
        self.newcomer.as_ref().is_some_and(|newcomer| newcomer.joining.is_map_bare()) && time_us < wait_us
    }

    /// A frame of a robot that does not know yet where in the map it is.
    pub(super) fn find_itself(&mut self, frame: &SensorFrame, anchored: &Anchored, tracking: Tracking) {
        let run_from_base = self.slam.locate(anchored);
        let Some(newcomer) = self.newcomer.as_mut().filter(|_| tracking != Tracking::Lost) else { return };
        let model = self.model.as_ref();
        let mut seen: Option<Appearance> = None;
        let mut describe = |seen: &mut Option<Appearance>| {
            if seen.is_none() {
                let (eyes, panorama) = (newcomer.eyes.as_mut()?, frame.panorama.as_ref()?);
                let described = eyes.appearance(panorama);
                *seen = described.inspect_err(|error| tracing::warn!("a panorama was not described: {error}")).ok();
            }
            Some(Descriptor::quantise(model?.id, &seen.as_ref()?.components))
        };
        let placed = newcomer.joining.update(frame, &run_from_base, || describe(&mut seen));
        let is_far =
            |before: &Pose2| (before.translation.vector - run_from_base.translation.vector).norm() >= REMEMBER_EVERY_M;
        let is_picture = frame.panorama.is_some() || model.is_none();
        if is_picture && newcomer.remembered.as_ref().is_none_or(is_far) {
            newcomer.remembered = Some(run_from_base);
            let descriptor = describe(&mut seen);
            let information = seen.as_ref().map_or(1.0, |seen| seen.information);
            if let (Some(seen), Some(model)) = (seen, model) {
                self.slam.observe_appearance(anchored, Arc::new(seen.components), match_threshold(model));
            }
            let scan = frame.scan.to_record();
            let observation =
                PlaceObservation { anchored: *anchored, frame: self.frame, scan, descriptor, information };
            self.builder.remember(observation);
        }
        if let Some(map_from_run) = placed {
            self.place(&map_from_run, frame.time_us);
        }
    }

    /// The robot has found its place: what it knows moves there, and from now on it writes.
    fn place(&mut self, map_from_run: &Pose2, time_us: u64) {
        tracing::info!(after_m = self.odometer_m, after_s = time_us as f64 * 1e-6, "joined the map");
        self.slam.place(map_from_run);
        // A goal that is being searched for lies in the frame of before.
        let _ = self.goals.finish();
        self.explorer.change_frame();
        if let Some(latest) = &mut self.latest {
            latest.map_from_base = self.slam.locate(&latest.anchored);
        }
        let Some((shared, written)) = self.newcomer.take().and_then(|newcomer| newcomer.shared) else { return };
        self.journal.resume(&shared, written);
        self.others.seniors = shared.nodes().map(|node| node.id.author).collect();
        self.take_shared_map(&shared, written);
        self.bind_explorer();
    }

    /// Looks whether nodes around the robot that others made are as they say.
    pub(super) fn doubt(&mut self, map_from_base: &Pose2, time_us: u64) {
        if !self.others.nodes.is_empty() {
            let here = to_fixed(map_from_base).position;
            let ops = self.builder.doubt(here, self.odometer_m, &self.journal, self.slam.grid());
            self.write_all(&ops, time_us);
        }
    }
}

impl Others {
    /// What has become of the nodes that others made since the last call.
    fn news(&mut self, state: &MapState, is_own: impl Fn(NodeId) -> bool, is_shown: bool) -> Vec<Told> {
        let mut news: Vec<Told> = Vec::new();
        let mut now = BTreeMap::new();
        for node in state.nodes().filter(|node| !is_own(node.id)) {
            let known = Known::of(&node);
            now.insert(node.id, known);
            if self.nodes.get(&node.id) != Some(&known) {
                let is_anchor = node.kind == NodeKind::Main && self.seniors.contains(&node.id.author);
                let told = ToldNode::new(from_fixed(node.pose), node.free_space, node.signature);
                news.push((node.id, Some(ToldNode { is_anchor, is_shown, ..told })));
            }
        }
        news.extend(self.nodes.keys().filter(|id| !now.contains_key(id)).map(|id| (*id, None)));
        self.nodes = now;
        if !news.is_empty() {
            let place = |(id, known): (&NodeId, &Known)| (point(known.pose.position), id.author);
            let told: Vec<(Point2, AuthorId)> = self.nodes.iter().map(place).collect();
            self.team.told = Arc::new(told);
        }
        news
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fht_sim::{SimConfig, Simulator, load};

    #[test]
    fn who_begins_a_map_is_not_lost_before_its_first_frame() {
        let world = Arc::new(load("museum", None, 1).unwrap());
        let start = world.start();
        let sim = SimConfig { camera_every: 0, ..SimConfig::default() };
        let mut simulator = Simulator::new(world, sim, start, 1);
        let mut mapper = Mapper::new(MapperConfig::default(), AuthorId(1), None).unwrap();
        assert!(!mapper.has_whereabouts());
        assert_eq!(mapper.whereabouts(), PoseReport::default());
        mapper.step(&simulator.sense_first()).unwrap();
        assert!(mapper.has_whereabouts());
        let said = mapper.whereabouts();
        assert_eq!((said.state, said.lost_because), (LocalizationState::Localized, None));
        // Who joins says at once that it looks for its place, and gives no reason for it.
        let newcomer = Mapper::joining(MapperConfig::default(), AuthorId(2), None, None).unwrap();
        assert!(newcomer.has_whereabouts());
        let said = newcomer.whereabouts();
        assert_eq!((said.state, said.lost_because), (LocalizationState::NotLocalized, None));
    }
}
