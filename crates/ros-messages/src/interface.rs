//! What a message, a service and an action are.

use serde::Serialize;
use serde::de::DeserializeOwned;

/// A message type.
pub trait RosMessage {
    /// Its ROS name, such as `sensor_msgs/msg/LaserScan`.
    const TYPE: &'static str;
}

/// A service type.
pub trait RosService {
    /// Its ROS name, such as `std_srvs/srv/SetBool`.
    const TYPE: &'static str;
    /// What is asked.
    type Request: Serialize + DeserializeOwned + Send;
    /// What is answered.
    type Response: Serialize + DeserializeOwned + Send;
}

/// An action type.
pub trait RosAction {
    /// Its ROS name, such as `nav2_msgs/action/NavigateToPose`.
    const TYPE: &'static str;
    /// What is to be reached.
    type Goal: Serialize + DeserializeOwned + Send;
    /// What came of it.
    type Result: Serialize + DeserializeOwned + Send + Clone + Default;
    /// How it goes.
    type Feedback: Serialize + DeserializeOwned + Send;
}
