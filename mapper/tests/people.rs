//! Exploring among people: nobody is run into, and the same seed gives the same map.

use fht_sim::SimSetup;
use mapper::program::{ExploreReport, ExploreTask, explore};
use mapper::run::MappingTask;

fn explored(people: u16) -> ExploreReport {
    let map = "museum".parse().expect("a name");
    let mapping = MappingTask { cameras: false, max_s: 100.0, ..MappingTask::new(map, "explorer") };
    let setup = SimSetup { people, ..SimSetup::of("museum") };
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().expect("a runtime");
    runtime.block_on(explore(ExploreTask::new(setup, mapping), |_| {})).expect("an exploration")
}

#[test]
fn among_people_nobody_is_run_into_and_nobody_is_in_the_map() {
    let (report, again) = (explored(20), explored(20));
    assert_eq!(report.map.digest, again.map.digest);
    let people = report.people.expect("people");
    assert_eq!((people.count, people.contacts.by_robot, report.collisions), (20, 0, 0));
    assert!(people.returns_in_nodes * 100 <= people.returns, "{people:?}");
    assert!(report.trajectory_error.is_some_and(|error| error.mean_m < 0.05), "{:?}", report.trajectory_error);
}
