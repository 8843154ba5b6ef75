//! Asks a `std_srvs/SetBool` service: `call [ENDPOINT [SERVICE]]`.

use fht_ros::{NodeConfig, RosNode};
use fht_ros_messages::msg::{SetBool, SetBoolRequest};
use fht_session::SessionConfig;
use std::error::Error;
use std::time::Duration;

#[tokio::main]
async fn main() -> Result<(), Box<dyn Error>> {
    let mut args = std::env::args().skip(1);
    let endpoint = args.next().unwrap_or_else(|| "tcp/127.0.0.1:7447".to_owned());
    let service = args.next().unwrap_or_else(|| "/set_bool".to_owned());
    let session = fht_session::open(&SessionConfig::from_options(vec![endpoint], None)).await?;
    let node = RosNode::join(session, NodeConfig::new("caller")).await?;
    let client = node.client::<SetBool>(&service).await?;
    let answer = client.call(&SetBoolRequest { data: true }, Duration::from_secs(5)).await?;
    println!("{}: {}", answer.success, answer.message);
    Ok(())
}
