//! Prints what is said on `/chatter`: `listener [ENDPOINT [COUNT]]`.

use fht_ros::{NodeConfig, Qos, RosNode};
use fht_ros_messages::msg::StringMsg;
use fht_session::SessionConfig;
use std::error::Error;

#[tokio::main]
async fn main() -> Result<(), Box<dyn Error>> {
    let mut args = std::env::args().skip(1);
    let endpoint = args.next().unwrap_or_else(|| "tcp/127.0.0.1:7447".to_owned());
    let count: u32 = args.next().map_or(Ok(u32::MAX), |count| count.parse())?;
    let session = fht_session::open(&SessionConfig::from_options(vec![endpoint], None)).await?;
    let node = RosNode::join(session, NodeConfig::new("listener")).await?;
    let chatter = node.subscribe::<StringMsg>("chatter", Qos::default()).await?;
    for _ in 0..count {
        println!("I heard: '{}'", chatter.next().await?.data);
    }
    Ok(())
}
