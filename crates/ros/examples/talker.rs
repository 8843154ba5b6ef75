//! Publishes a text on `/chatter` twice a second: `talker [ENDPOINT [COUNT]]`. ROS 2's
//! `demo_nodes_cpp listener` hears it.

use fht_ros::{NodeConfig, Qos, RosNode};
use fht_ros_messages::msg::StringMsg;
use fht_session::SessionConfig;
use std::error::Error;
use std::time::Duration;

#[tokio::main]
async fn main() -> Result<(), Box<dyn Error>> {
    let mut args = std::env::args().skip(1);
    let endpoint = args.next().unwrap_or_else(|| "tcp/127.0.0.1:7447".to_owned());
    let count: u32 = args.next().map_or(Ok(u32::MAX), |count| count.parse())?;
    let session = fht_session::open(&SessionConfig::from_options(vec![endpoint], None)).await?;
    let node = RosNode::join(session, NodeConfig::new("talker")).await?;
    let chatter = node.publisher("chatter", Qos::default()).await?;
    for number in 1..=count {
        chatter.publish(&StringMsg { data: format!("Hello World: {number}") })?;
        println!("Publishing: 'Hello World: {number}'");
        tokio::time::sleep(Duration::from_millis(500)).await;
    }
    Ok(())
}
