//! `zenoh-bridge-ros2dds` as a test needs it: the plugin of the Eclipse project, unmodified, in a
//! Zenoh router that listens at an endpoint.
//!
//! `dds-bridge ENDPOINT DOMAIN` prints `ready` and runs until it is ended.

use zenoh::Config;
use zenoh::internal::plugins::PluginsManager;
use zenoh::internal::runtime::RuntimeBuilder;
use zenoh_plugin_ros2dds::ROS2Plugin;

fn config(endpoint: &str, domain: u32) -> zenoh::Result<Config> {
    let mut config = Config::default();
    config.insert_json5("mode", "\"router\"")?;
    config.insert_json5("listen/endpoints", &format!("[{endpoint:?}]"))?;
    config.insert_json5("scouting/multicast/enabled", "false")?;
    config.insert_json5("plugins/ros2dds", &format!(r#"{{ domain: {domain}, ros_automatic_discovery_range: "SUBNET" }}"#))?;
    // The bridge's publishers have caches, for which samples have times.
    config.insert_json5("timestamping", "{ enabled: true }")?;
    Ok(config)
}

#[tokio::main]
async fn main() -> zenoh::Result<()> {
    let mut args = std::env::args().skip(1);
    let (Some(endpoint), Some(domain)) = (args.next(), args.next()) else {
        return Err("dds-bridge ENDPOINT DOMAIN".into());
    };
    let mut plugins = PluginsManager::static_plugins_only();
    plugins.declare_static_plugin::<ROS2Plugin, _>("ros2dds", true);
    let config = config(&endpoint, domain.parse()?)?;
    let mut runtime = RuntimeBuilder::new(config.into()).plugins_manager(plugins).build().await?;
    runtime.start().await?;
    println!("ready");
    tokio::signal::ctrl_c().await?;
    Ok(())
}
