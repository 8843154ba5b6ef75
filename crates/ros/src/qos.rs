//! Quality of service: what a publisher offers and a subscription asks for, and how tokens say it.

/// Whether messages may be lost.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum QosReliability {
    /// Not while both are there.
    #[default]
    Reliable,
    /// Under load they may.
    BestEffort,
}

/// Whether those who come later get the last messages.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum QosDurability {
    /// They do not.
    #[default]
    Volatile,
    /// They do (`/map`, `/tf_static`).
    TransientLocal,
}

/// Quality of service of a topic. The default is ROS's: reliable, volatile, the last 10.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Qos {
    /// Whether messages may be lost.
    pub reliability: QosReliability,
    /// Whether those who come later get the last messages.
    pub durability: QosDurability,
    /// How many messages wait, or are kept for those who come later. 0 is 42, as with `rmw_zenoh`.
    pub depth: usize,
}

impl Default for Qos {
    fn default() -> Self {
        Self { reliability: QosReliability::Reliable, durability: QosDurability::Volatile, depth: 10 }
    }
}

/// What `rmw_zenoh` takes for a depth that is not given.
const DEPTH_OF_NONE: usize = 42;

impl Qos {
    /// Of sensors (`SensorDataQoS`): the newest 5, and they may be lost.
    #[must_use]
    pub fn sensor_data() -> Self {
        Self { reliability: QosReliability::BestEffort, depth: 5, ..Self::default() }
    }

    /// Of states that do not change often: who comes later gets the last `depth` messages.
    #[must_use]
    pub fn latched(depth: usize) -> Self {
        Self { durability: QosDurability::TransientLocal, depth, ..Self::default() }
    }

    /// How many messages are kept.
    #[must_use]
    pub fn kept(&self) -> usize {
        if self.depth == 0 { DEPTH_OF_NONE } else { self.depth }
    }

    /// Why a subscription that asks for `self` gets nothing, or less, from a publisher with
    /// `offered`: which policy, and what to do. DDS connects no such pair; Zenoh connects all.
    #[must_use]
    pub fn mismatch(&self, offered: &Self) -> Option<&'static str> {
        if self.reliability == QosReliability::Reliable && offered.reliability == QosReliability::BestEffort {
            Some("it is published best-effort and asked for reliably; ask best-effort")
        } else if self.durability == QosDurability::TransientLocal && offered.durability == QosDurability::Volatile {
            Some("it is published volatile and asked for transient-local; who comes later gets nothing")
        } else {
            None
        }
    }

    /// As the tokens of `rmw_zenoh` write it; what is ROS's default stays empty.
    #[must_use]
    pub(crate) fn to_rmw(self) -> String {
        let reliability = if self.reliability == QosReliability::BestEffort { "2" } else { "" };
        let durability = if self.durability == QosDurability::TransientLocal { "1" } else { "" };
        format!("{reliability}:{durability}:,{}:,:,:,,", self.kept())
    }

    /// The reverse; `None` if it is something else.
    pub(crate) fn from_rmw(text: &str) -> Option<Self> {
        let [reliability, durability, history, ..] = text.split(':').collect::<Vec<_>>()[..] else { return None };
        let depth = history.split_once(',').map_or("", |(_, depth)| depth);
        Some(Self {
            reliability: if reliability == "2" { QosReliability::BestEffort } else { QosReliability::Reliable },
            durability: if durability == "1" { QosDurability::TransientLocal } else { QosDurability::Volatile },
            depth: if depth.is_empty() { 0 } else { depth.parse().ok()? },
        })
    }

    /// Reads what the tokens of `zenoh-bridge-ros2dds` say: DDS's numbers, where 1 is reliable and
    /// transient-local.
    pub(crate) fn from_bridge(text: &str) -> Option<Self> {
        let [_, reliability, durability, history, ..] = text.split(':').collect::<Vec<_>>()[..] else { return None };
        let depth = history.split_once(',').map_or("", |(_, depth)| depth);
        Some(Self {
            reliability: if reliability == "1" { QosReliability::Reliable } else { QosReliability::BestEffort },
            durability: if durability == "1" { QosDurability::TransientLocal } else { QosDurability::Volatile },
            depth: depth.parse().unwrap_or(1),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tokens_say_it_as_rmw_zenoh_does() {
        for (qos, text) in
            [(Qos::default(), "::,10:,:,:,,"), (Qos::sensor_data(), "2::,5:,:,:,,"), (Qos::latched(1), ":1:,1:,:,:,,")]
        {
            assert_eq!(qos.to_rmw(), text);
            assert_eq!(Qos::from_rmw(text), Some(qos));
        }
        assert_eq!(Qos { depth: 0, ..Qos::default() }.to_rmw(), "::,42:,:,:,,");
        assert_eq!(Qos::from_rmw("1:2:1,7:1,0:,:,,").map(|qos| qos.depth), Some(7));
        assert_eq!(Qos::from_rmw("::"), Some(Qos { depth: 0, ..Qos::default() }));
        assert_eq!(Qos::from_rmw("nothing"), None);
        assert_eq!(Qos::from_rmw("::,many:"), None);
    }

    #[test]
    fn the_bridge_says_it_in_numbers_of_dds() {
        assert_eq!(Qos::from_bridge(":1:1:0,1"), Some(Qos::latched(1)));
        assert_eq!(Qos::from_bridge("K:0:0:0,5:typehash=RIHS01_1;"), Some(Qos::sensor_data()));
        assert_eq!(Qos::from_bridge(":::").map(|qos| qos.reliability), Some(QosReliability::BestEffort));
        assert_eq!(Qos::from_bridge("K"), None);
    }

    #[test]
    fn what_does_not_fit_is_named() {
        let (sensor, plain, latched) = (Qos::sensor_data(), Qos::default(), Qos::latched(1));
        assert!(plain.mismatch(&sensor).is_some_and(|text| text.contains("best-effort")));
        assert!(latched.mismatch(&plain).is_some_and(|text| text.contains("transient-local")));
        assert_eq!((sensor.mismatch(&plain), plain.mismatch(&latched)), (None, None));
    }
}
