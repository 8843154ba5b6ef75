//! Nodes on one graph, through a router: topics, last messages for who comes later, services,
//! actions, and who is there; in both forms of keys.
#![allow(clippy::unwrap_used)] // tests may panic

use fht_ros::{EndpointKind, KeyForm, NodeConfig, Qos, RosError, RosNode};
use fht_ros_messages::msg::{
    GoalStatusMsg, PoseStamped, SetBool, SetBoolRequest, SetBoolResponse, StringMsg, TfMessage, TransformStamped,
};
use fht_ros_messages::nav2::{NavigateToPose, NavigateToPoseFeedback, NavigateToPoseGoal, NavigateToPoseResult};
use std::time::Duration;
use tokio::time::timeout;
use zenoh::{Config, Session};

const PATIENCE: Duration = Duration::from_secs(10);

async fn open(mode: &str, key: &str, endpoint: &str) -> Session {
    let mut config = Config::default();
    config.insert_json5("mode", &format!("'{mode}'")).unwrap();
    config.insert_json5("scouting/multicast/enabled", "false").unwrap();
    config.insert_json5(&format!("{key}/endpoints"), &format!("['{endpoint}']")).unwrap();
    zenoh::open(config).await.unwrap()
}

/// A robot's router, and two sessions at it.
async fn graph() -> (Session, [Session; 2]) {
    let endpoint = format!("tcp/{}", fht_reserved_port::reserve().unwrap());
    let router = open("router", "listen", &endpoint).await;
    let sessions = [open("client", "connect", &endpoint).await, open("client", "connect", &endpoint).await];
    (router, sessions)
}

async fn nodes(sessions: &[Session; 2], form: KeyForm) -> [RosNode; 2] {
    let config = |name: &str| NodeConfig { namespace: "r1".to_owned(), domain: 3, form, ..NodeConfig::new(name) };
    [
        RosNode::join(sessions[0].clone(), config("robot")).await.unwrap(),
        RosNode::join(sessions[1].clone(), config("mapper")).await.unwrap(),
    ]
}

fn text(data: &str) -> StringMsg {
    StringMsg { data: data.to_owned() }
}

async fn soon<T>(future: impl Future<Output = T>) -> T {
    timeout(PATIENCE, future).await.expect("it does not take that long")
}

async fn topics_work(robot: &RosNode, mapper: &RosNode) {
    let heard = mapper.subscribe::<StringMsg>("chatter", Qos { depth: 3, ..Qos::default() }).await.unwrap();
    let chatter = robot.publisher("/r1/chatter", Qos::default()).await.unwrap();
    soon(async {
        while !chatter.is_heard().await.unwrap() {
            tokio::time::sleep(Duration::from_millis(10)).await;
        }
    })
    .await;
    for number in 0..9 {
        chatter.publish(&text(&number.to_string())).unwrap();
    }
    soon(async {
        while heard.dropped() < 6 {
            tokio::time::sleep(Duration::from_millis(10)).await;
        }
    })
    .await;
    for number in 6..9 {
        assert_eq!(soon(heard.next()).await.unwrap().data, number.to_string());
    }

    // Who comes later gets the last message once, and those that follow.
    let publisher = robot.publisher("tf_static", Qos::latched(1)).await.unwrap();
    let witness = mapper.subscribe::<TfMessage>("tf_static", Qos { depth: 2, ..Qos::default() }).await.unwrap();
    soon(async {
        while !publisher.is_heard().await.unwrap() {
            tokio::time::sleep(Duration::from_millis(10)).await;
        }
    })
    .await;
    let frame = |name: &str| TransformStamped { child_frame_id: name.to_owned(), ..TransformStamped::default() };
    for name in ["old", "laser"] {
        publisher.publish(&TfMessage { transforms: vec![frame(name)] }).unwrap();
        // Once it has arrived, nobody who comes later hears it on its way.
        assert_eq!(soon(witness.next()).await.unwrap().transforms[0].child_frame_id, name);
    }
    let late = mapper.subscribe::<TfMessage>("tf_static", Qos::latched(10)).await.unwrap();
    assert_eq!(soon(late.next()).await.unwrap().transforms[0].child_frame_id, "laser");
    publisher.publish(&TfMessage { transforms: vec![frame("camera")] }).unwrap();
    assert_eq!(soon(late.next()).await.unwrap().transforms[0].child_frame_id, "camera");

    // A publisher that comes after the subscription, and has spoken before it was heard of.
    let early = mapper.subscribe::<StringMsg>("late", Qos::latched(1)).await.unwrap();
    let publisher = robot.publisher("late", Qos::latched(1)).await.unwrap();
    publisher.publish(&text("here")).unwrap();
    assert_eq!(soon(early.next()).await.unwrap().data, "here");
    tokio::time::sleep(Duration::from_millis(200)).await;
    assert!(early.take_raw().is_none(), "what comes twice is taken once");
}

async fn services_work(robot: &RosNode, mapper: &RosNode) {
    let client = mapper.client::<SetBool>("switch").await.unwrap();
    let nobody = client.call(&SetBoolRequest { data: true }, Duration::from_millis(300)).await;
    assert!(matches!(nobody, Err(RosError::NoServer(_))), "{nobody:?}");
    let server = robot.server::<SetBool>("switch").await.unwrap();
    let answering = tokio::spawn(async move {
        let call = server.next().await;
        let message = format!("it was {}", call.request.data);
        call.respond(&SetBoolResponse { success: true, message }).unwrap();
        drop(server.next().await);
    });
    tokio::time::sleep(Duration::from_millis(200)).await;
    let answer = client.call(&SetBoolRequest { data: true }, PATIENCE).await.unwrap();
    assert!(answer.success && answer.message == "it was true", "{answer:?}");
    let dropped = client.call(&SetBoolRequest { data: true }, PATIENCE).await;
    assert!(matches!(dropped, Err(RosError::NoServer(_))), "{dropped:?}");
    answering.await.unwrap();
}

fn goal(x: f64) -> NavigateToPoseGoal {
    let mut pose = PoseStamped::default();
    pose.pose.position.x = x;
    NavigateToPoseGoal { pose, behavior_tree: String::new() }
}

async fn actions_work(robot: &RosNode, mapper: &RosNode) {
    let server = robot.action_server::<NavigateToPose>("navigate_to_pose").await.unwrap();
    let client = mapper.action_client::<NavigateToPose>("navigate_to_pose").await.unwrap();
    tokio::time::sleep(Duration::from_millis(200)).await;
    let driving = tokio::spawn(async move {
        let first = server.next().await;
        assert_eq!(first.goal.pose.pose.position.x, 1.0);
        let first = first.accept().unwrap();
        // Until the client has subscribed at the router, and beyond.
        for metres in (0..10_u8).rev() {
            let feedback = NavigateToPoseFeedback { distance_remaining: f32::from(metres), ..Default::default() };
            first.feedback(feedback).unwrap();
            tokio::time::sleep(Duration::from_millis(50)).await;
        }
        first.succeed(NavigateToPoseResult::default());
        server.next().await.reject();
        let third = server.next().await.accept().unwrap();
        third.canceling().await;
        third.canceled(NavigateToPoseResult { error_code: 1, error_msg: "as you wish".to_owned() });
        drop(server.next().await.accept().unwrap());
        // The server stays until the last result is asked for.
        tokio::time::sleep(Duration::from_secs(1)).await;
    });
    let sent = client.send(goal(1.0)).await.unwrap();
    assert!(soon(sent.feedback()).await.unwrap().distance_remaining < 10.0);
    assert_eq!(soon(sent.result()).await.unwrap().status, GoalStatusMsg::SUCCEEDED);
    assert!(!sent.cancel().await.unwrap(), "it has ended");

    let rejected = client.send(goal(2.0)).await;
    assert!(matches!(rejected, Err(RosError::Refused { .. })));

    let sent = client.send(goal(3.0)).await.unwrap();
    assert!(sent.cancel().await.unwrap());
    let end = soon(sent.result()).await.unwrap();
    assert_eq!((end.status, end.result.error_msg.as_str()), (GoalStatusMsg::CANCELED, "as you wish"));

    let sent = client.send(goal(4.0)).await.unwrap();
    assert_eq!(soon(sent.result()).await.unwrap().status, GoalStatusMsg::ABORTED);
    driving.await.unwrap();
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn nodes_of_rmw_zenoh_speak_and_see_each_other() {
    let (_router, sessions) = graph().await;
    let [robot, mapper] = nodes(&sessions, KeyForm::Rmw).await;
    let _scan = robot.publisher::<StringMsg>("seen", Qos::sensor_data()).await.unwrap();
    let there = soon(async {
        loop {
            let there = mapper.endpoints(Duration::from_secs(2)).await.unwrap();
            if !there.is_empty() {
                return there;
            }
        }
    })
    .await;
    assert_eq!((there.len(), there[0].kind, there[0].name.as_str()), (1, EndpointKind::Publisher, "/r1/seen"));
    assert_eq!((there[0].node.as_str(), there[0].qos), ("/r1/robot", Qos::sensor_data()));
    // Another program's node is another one, whatever its name; one's own is not.
    let twin = RosNode::join(sessions[1].clone(), robot.config().clone()).await.unwrap();
    assert_eq!(soon(twin.others(Duration::from_secs(2))).await.unwrap().len(), 1);
    assert_eq!(soon(robot.others(Duration::from_secs(2))).await.unwrap(), []);
    topics_work(&robot, &mapper).await;
    services_work(&robot, &mapper).await;
    actions_work(&robot, &mapper).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn keys_of_the_bridge_work_as_well() {
    let (_router, sessions) = graph().await;
    let [robot, mapper] = nodes(&sessions, KeyForm::Bridge).await;
    let heard = mapper.subscribe::<StringMsg>("/chatter", Qos::default()).await.unwrap();
    let chatter = robot.publisher("/chatter", Qos::default()).await.unwrap();
    soon(async {
        while !chatter.is_heard().await.unwrap() {
            tokio::time::sleep(Duration::from_millis(10)).await;
        }
    })
    .await;
    chatter.publish(&text("over DDS")).unwrap();
    let received = soon(heard.next_raw()).await;
    assert_eq!((received.decode::<StringMsg>().unwrap().data.as_str(), received.attachment), ("over DDS", None));
    services_work(&robot, &mapper).await;
    actions_work(&robot, &mapper).await;
}
