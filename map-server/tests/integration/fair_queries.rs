//! Long questions do not stand before short ones, however many there are.

use crate::support::client;
use crate::support::site::Site;
use fht_proto::api::reply::{ErrorCode, ErrorReply};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::Duration;
use zenoh::Session;
use zenoh::query::ConsolidationMode;

/// Whether a question is answered. A server's links drop what they cannot take at once, so a robot
/// asks again; here twice.
async fn ask_again(session: &Session, selector: &str) -> Result<(), String> {
    let mut complaint = String::new();
    for _ in 0..3 {
        let replies = session.get(selector).timeout(Duration::from_secs(2)).await.unwrap();
        match replies.recv_async().await.map(zenoh::query::Reply::into_result) {
            Ok(Ok(_)) => return Ok(()),
            Ok(Err(error)) => complaint = String::from_utf8_lossy(&error.payload().to_bytes()).into_owned(),
            Err(_) => complaint = "no reply".to_owned(),
        }
    }
    Err(complaint)
}

#[tokio::test(flavor = "multi_thread", worker_threads = 4)]
async fn short_questions_are_answered_among_many_long_ones() {
    let site = Site::with(1000).await;
    let rogue = client(&site.endpoint).await;
    let (stop, answered) = (Arc::new(AtomicBool::new(false)), Arc::new(AtomicUsize::new(0)));
    let busy = Arc::new(AtomicUsize::new(0));
    let asking = {
        let (stop, answered, busy) = (Arc::clone(&stop), Arc::clone(&answered), Arc::clone(&busy));
        tokio::spawn(async move {
            while !stop.load(Ordering::Relaxed) {
                // Many at a time, none of which is waited for.
                for _ in 0..20 {
                    let (answered, busy) = (Arc::clone(&answered), Arc::clone(&busy));
                    let callback = move |reply: zenoh::query::Reply| match reply.result() {
                        Ok(_) => _ = answered.fetch_add(1, Ordering::Relaxed),
                        Err(error) => {
                            // Or Zenoh's word that the time is up.
                            let Ok(error) = serde_json::from_slice::<ErrorReply>(&error.payload().to_bytes()) else {
                                return;
                            };
                            assert_eq!(error.code, ErrorCode::Busy, "{error}");
                            assert!(error.retry_after_s.is_some_and(|seconds| seconds > 0), "{error}");
                            busy.fetch_add(1, Ordering::Relaxed);
                        }
                    };
                    let get = rogue.get("fht/museum/diff?from=1;to=999").consolidation(ConsolidationMode::None);
                    get.callback(callback).await.unwrap();
                }
                tokio::time::sleep(Duration::from_millis(50)).await;
            }
        })
    };
    while busy.load(Ordering::Relaxed) == 0 {
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
    for round in 0..30 {
        for question in ["head", "since?vector=", "path?from=0,0;to=40,0", "rules", "snapshot?version=50"] {
            let answer = ask_again(&site.session, &format!("fht/museum/{question}")).await;
            assert!(answer.is_ok(), "{round}, {question}: {answer:?}");
        }
    }
    stop.store(true, Ordering::Relaxed);
    asking.await.unwrap();
    assert!(answered.load(Ordering::Relaxed) > 0, "long ones are answered, too");
}
