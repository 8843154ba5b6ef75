use super::*;
use std::time::Instant;

const PATIENCE: Duration = Duration::from_secs(20);

#[test]
fn a_late_answer_does_not_hold_up_the_loop() {
    let (go, gate) = channel::<()>();
    let ask = move |job: u32| {
        let _ = gate.recv();
        job
    };
    let mut worker = BackgroundWorker::newest_first("test", Taking::WhenThere, PATIENCE, ask).expect("a thread");
    assert_eq!(worker.take(), None);
    worker.replace(1);
    let began = Instant::now();
    assert!((0..100).all(|_| worker.take().is_none()) && worker.is_pending());
    assert!(began.elapsed() < PATIENCE / 4);
    worker.replace(2);
    for _ in 0..2 {
        go.send(()).expect("the thread lives");
    }
    let answer = loop {
        if let Some(answer) = worker.take() {
            break answer;
        }
        assert!(began.elapsed() < PATIENCE);
        std::thread::sleep(Duration::from_millis(1));
    };
    assert_eq!(answer, 2, "only the newest job counts");
    assert!(!worker.is_pending() && worker.take().is_none());
}

#[test]
fn in_simulated_time_the_answer_comes_at_its_frame_however_slow_the_thread() {
    for delay_ms in [0, 30] {
        let ask = move |job: u32| {
            std::thread::sleep(Duration::from_millis(delay_ms));
            job
        };
        let mut worker =
            BackgroundWorker::newest_first("test", Taking::AfterFrames(3), PATIENCE, ask).expect("a thread");
        worker.replace(1);
        assert_eq!(worker.take(), None);
        worker.replace(2);
        assert_eq!([worker.take(), worker.take(), worker.take(), worker.take()], [None, None, Some(2), None]);
        worker.replace(3);
        worker.cancel();
        assert!((0..5).all(|_| worker.take().is_none()));
    }
}

#[test]
fn a_result_is_taken_at_its_frame_and_not_before() {
    let mut twice = BackgroundWorker::one_by_one("test", Pace::Repeatable, |x: i32| 2 * x).expect("a thread");
    twice.submit(21, 10);
    assert!(!twice.is_idle());
    twice.submit(1, 11);
    assert_eq!(twice.take_due(9), None);
    assert_eq!(twice.take_due(10), Some(42));
    assert_eq!(twice.take_due(11), None);
    assert!(twice.is_idle());
}

#[test]
fn in_real_time_nothing_is_waited_for() {
    let (go, gate) = channel::<()>();
    let work = move |x: i32| gate.recv().map_or(0, |()| x);
    let mut slow = BackgroundWorker::one_by_one("test", Pace::RealTime, work).expect("a thread");
    slow.submit(7, 0);
    for frame in 0..100 {
        assert_eq!(slow.take_due(frame), None);
    }
    go.send(()).expect("the thread waits");
    assert_eq!(slow.finish(), Some(7));
}

#[test]
fn a_thread_that_fails_is_noticed() {
    let mut broken = BackgroundWorker::one_by_one("test", Pace::Repeatable, |x: i32| 10 / x).expect("a thread");
    broken.submit(0, 0);
    assert_eq!(broken.take_due(0), None);
    assert!(broken.has_ended() && !broken.is_idle());
}
