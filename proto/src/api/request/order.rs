//! Operators' orders to a server.

use crate::api::deletion::DeletionOrder;
use crate::api::fleet::BlockedReport;
use crate::api::keys::AdminAction;
use crate::api::quota::QuotaChange;
use crate::api::reply::{ErrorReply, Series};
use crate::api::request::parameters::{Parameters, bad_request};
use crate::model::validate::Validate;
use crate::{RobotName, VersionVector, decode};

/// What an operator wants done.
#[derive(Clone, Debug, PartialEq)]
pub enum AdminOrder {
    /// Fold all but the newest so many versions.
    Retain {
        /// How many versions stay.
        keep: u64,
    },
    /// Take in a part of a map.
    Import {
        /// The part.
        series: Series,
        /// The vector of the whole, if it is given.
        whole: Option<VersionVector>,
    },
    /// Delete the map.
    Delete(DeletionOrder),
    /// Do not delete it after all.
    Undelete,
    /// Open what robots reported blocked.
    Unblock {
        /// Whose reports; none: everybody's.
        robot: Option<String>,
        /// For how long the robot's reports are not to count, seconds.
        ignore_s: f64,
    },
    /// Have what a robot reported blocked stay so, whatever it says or does.
    KeepBlocked {
        /// Whose reports.
        robot: String,
        /// For how long, seconds.
        for_s: f64,
    },
    /// Say what writers take and may take, after the change, if there is one.
    Quota(Option<QuotaChange>),
}

/// Reads an operator's order.
///
/// # Errors
/// `BAD_REQUEST` with a sentence that says what was expected.
pub fn parse_order<'a>(
    action: AdminAction,
    parameters: impl Iterator<Item = (&'a str, &'a str)>,
    payload: Option<&[u8]>,
) -> Result<AdminOrder, ErrorReply> {
    match action {
        AdminAction::Retain => {
            let given = Parameters::of("retain", parameters, &["keep"])?;
            let keep = given.parsed("keep", "a number of versions")?;
            let missing = || bad_request("say how many versions are to stay, such as retain?keep=1000".to_owned());
            keep.map(|keep| AdminOrder::Retain { keep }).ok_or_else(missing)
        }
        AdminAction::Import => {
            let given = Parameters::of("import", parameters, &["vector"])?;
            let whole = given.vector("vector")?;
            let missing = || bad_request("import needs a series of increments in the payload".to_owned());
            let series = decode(payload.ok_or_else(missing)?)
                .map_err(|error| bad_request(format!("the payload is not a series of increments: {error}")))?;
            Ok(AdminOrder::Import { series, whole })
        }
        AdminAction::Delete => {
            Parameters::of("delete", parameters, &[])?;
            let missing = || {
                bad_request("delete needs a payload, such as {grace_s: 604800, reason: mistyped, by: desk}".to_owned())
            };
            let order: DeletionOrder = serde_json::from_slice(payload.ok_or_else(missing)?)
                .map_err(|error| bad_request(format!("the payload is not an order to delete: {error}")))?;
            order.validate().map_err(|error| bad_request(error.to_string()))?;
            Ok(AdminOrder::Delete(order))
        }
        AdminAction::Undelete => Parameters::of("undelete", parameters, &[]).map(|_| AdminOrder::Undelete),
        AdminAction::Unblock => {
            let given = Parameters::of("unblock", parameters, &["robot", "ignore_s"])?;
            let (robot, ignore_s) = (robot_named(&given)?, seconds(&given, "ignore_s")?);
            if robot.is_none() && ignore_s.is_some() {
                return Err(bad_request("ignore_s needs robot: whose reports are not to count".to_owned()));
            }
            Ok(AdminOrder::Unblock { robot, ignore_s: ignore_s.unwrap_or(0.0) })
        }
        AdminAction::KeepBlocked => {
            let given = Parameters::of("keep-blocked", parameters, &["robot", "for_s"])?;
            let missing = || bad_request("say whose reports stay, and for how long: robot=amr-7;for_s=3600".to_owned());
            let (robot, for_s) = robot_named(&given)?.zip(seconds(&given, "for_s")?).ok_or_else(missing)?;
            Ok(AdminOrder::KeepBlocked { robot, for_s })
        }
        AdminAction::Quota => quota_change(parameters).map(AdminOrder::Quota),
    }
}

/// What a quota is to be; none if nothing is given.
fn quota_change<'a>(parameters: impl Iterator<Item = (&'a str, &'a str)>) -> Result<Option<QuotaChange>, ErrorReply> {
    let names = ["writer", "of_role", "map_share", "total_share", "increments_per_s", "taken_per_hour_share"];
    let mut parameters = parameters.peekable();
    if parameters.peek().is_none() {
        return Ok(None);
    }
    let given = Parameters::of("quota", parameters, &names)?;
    let number = |name| given.parsed::<f64>(name, "a number");
    let writer: Option<RobotName> = given.parsed("writer", "the name of a robot or operator")?;
    let missing = || bad_request("say whose quota: writer=amr-7;map_share=0.8".to_owned());
    let change = QuotaChange {
        writer: writer.ok_or_else(missing)?.to_string(),
        of_role: given.parsed("of_role", "true or false")?.unwrap_or(false),
        map_share: number("map_share")?,
        total_share: number("total_share")?,
        increments_per_s: number("increments_per_s")?,
        taken_per_hour_share: number("taken_per_hour_share")?,
    };
    change.validate().map_err(|error| bad_request(error.to_string()))?;
    Ok(Some(change))
}

/// The robot that is named, if one is.
fn robot_named(given: &Parameters<'_>) -> Result<Option<String>, ErrorReply> {
    let robot: Option<RobotName> = given.parsed("robot", "the name of a robot")?;
    Ok(robot.map(|robot| robot.to_string()))
}

/// A time of up to a day, if one is given.
fn seconds(given: &Parameters<'_>, name: &str) -> Result<Option<f64>, ErrorReply> {
    let seconds: Option<f64> = given.parsed(name, "a number of seconds")?;
    match seconds {
        Some(seconds) if !(0.0..=BlockedReport::MAX_S).contains(&seconds) => {
            Err(bad_request(format!("{name}={seconds}: 0 to {} are allowed", BlockedReport::MAX_S)))
        }
        seconds => Ok(seconds),
    }
}
