//! Answers that are lost on the way: a question is put again, and silence that comes at once is not
//! waited for.

use crate::stand_in::listen;
use fht_client::{AskError, ask_until_answered};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};
use zenoh::Wait;

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_question_whose_answer_is_lost_is_put_again() {
    let (session, _) = listen().await;
    let asked = Arc::new(AtomicUsize::new(0));
    let count = Arc::clone(&asked);
    let held = std::sync::Mutex::new(Vec::new());
    let answer = move |query: zenoh::query::Query| match count.fetch_add(1, Ordering::Relaxed) {
        // The end of the first answer never comes.
        0 => held.lock().expect("a lock").push(query),
        _ => query.reply("fht/m/head", "here").wait().expect("a reply"),
    };
    let _server = session.declare_queryable("fht/m/head").callback(answer).await.expect("a queryable");
    let answer = ask_until_answered(&session, "fht/m/head", Duration::from_secs(60)).await;
    assert!(answer.is_ok_and(|bytes| bytes == b"here") && asked.load(Ordering::Relaxed) == 2);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn where_nobody_is_nobody_is_waited_for() {
    let (session, _) = listen().await;
    let begin = Instant::now();
    let silent = ask_until_answered(&session, "fht/m/head", Duration::from_secs(60)).await;
    assert!(matches!(silent, Err(AskError::Silent)), "{silent:?}");
    assert!(begin.elapsed() < Duration::from_secs(3), "silence is told at once");
}
