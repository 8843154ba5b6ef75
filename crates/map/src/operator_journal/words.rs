//! What an increment does, in words.

use fht_proto::{AuthorId, Op, ReleaseId, ZoneRule};

/// Of more sentences the number of the others is told.
const MAX_SENTENCES: usize = 20;

/// How many there are of what is not told one by one.
#[derive(Default)]
struct Counts {
    put: usize,
    removed: usize,
    changed: usize,
    edges_put: usize,
    edges_removed: usize,
}

impl Counts {
    fn sentences(&self) -> impl Iterator<Item = String> {
        let say = |count: usize, what: &str, done: &str| match count {
            0 => None,
            1 => Some(format!("1 {what} is {done}")),
            _ => Some(format!("{count} {what}s are {done}")),
        };
        let all = [
            say(self.put, "node", "put"),
            say(self.removed, "node", "taken away"),
            say(self.changed, "node", "changed"),
            say(self.edges_put, "edge", "put"),
            say(self.edges_removed, "edge", "taken away"),
        ];
        all.into_iter().flatten()
    }
}

/// What the operations of `author` do, a sentence each.
pub(super) fn in_words<'a>(author: AuthorId, ops: impl Iterator<Item = &'a Op>) -> Vec<String> {
    let (mut counts, mut told, mut more) = (Counts::default(), Vec::new(), 0);
    for op in ops {
        match op {
            Op::PutNode { .. } => counts.put += 1,
            Op::RemoveNode { .. } => counts.removed += 1,
            Op::SetPose { .. } => counts.changed += 1,
            Op::PutEdge { .. } => counts.edges_put += 1,
            Op::RemoveEdge { .. } => counts.edges_removed += 1,
            // They come with the node that they belong to.
            Op::SetFreeSpace { .. } | Op::SetSignature { .. } | Op::SetTrust { .. } | Op::PutModel { .. } => {}
            _ if told.len() == MAX_SENTENCES => more += 1,
            op => told.extend(sentence(author, op)),
        }
    }
    told.extend(counts.sentences());
    told.extend((more > 0).then(|| format!("and {more} more")));
    told
}

/// What only operators write.
fn sentence(author: AuthorId, op: &Op) -> Option<String> {
    Some(match op {
        Op::SetClosed { edge, closed } => {
            let state = if *closed { "closed" } else { "open" };
            format!("the edge {} {} is {state}", edge.low(), edge.high())
        }
        Op::SetPlace { name, pose: None } => format!("place {name} is taken away"),
        Op::SetPlace { name, pose: Some(pose) } => {
            let (x, y) = (pose.position.x(), pose.position.y());
            format!("place {name} is at {x:.2},{y:.2}, {:.0}°", pose.yaw().to_degrees())
        }
        Op::SetZone { name, zone: None } => format!("zone {name} is taken away"),
        Op::SetZone { name, zone: Some(zone) } => {
            let rule = match zone.rule {
                ZoneRule::KeepOut => "keep out".to_owned(),
                ZoneRule::SpeedLimit(mm_per_s) => format!("at most {} m/s", f64::from(mm_per_s) / 1000.0),
            };
            format!("zone {name}: {rule}, {} corners", zone.corners.len())
        }
        Op::PutRelease { name, release } => {
            let (id, version) = (ReleaseId { author, name: name.clone() }, release.vector.version());
            format!("release {id} is made of version {version}")
        }
        Op::RemoveRelease { id } => format!("release {id} is deleted"),
        Op::Enable { release: Some(id) } => format!("robots use release {id}"),
        Op::Enable { release: None } => "robots use the newest state".to_owned(),
        Op::SetFloorPlan { plan: None } => "the map says of no floor plan how it lies".to_owned(),
        Op::SetFloorPlan { plan: Some(plan) } => format!("the floor plan {} is laid under the map", plan.image),
        Op::SetDatum { datum: None } => "where on earth the map is, is taken away".to_owned(),
        Op::SetDatum { datum: Some(datum) } => {
            format!("the map is at latitude {}, longitude {}", datum.latitude_deg(), datum.longitude_deg())
        }
        Op::PutNode { .. }
        | Op::RemoveNode { .. }
        | Op::SetPose { .. }
        | Op::SetFreeSpace { .. }
        | Op::SetSignature { .. }
        | Op::PutEdge { .. }
        | Op::RemoveEdge { .. }
        | Op::PutModel { .. }
        | Op::SetTrust { .. } => return None,
    })
}
