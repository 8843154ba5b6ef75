//! Zenoh sessions that wait for their routers and say what keeps them.
//!
//! A robot is a client of the map server or of any router, and keeps trying to connect. The map
//! server opens its own session in the same way, from a configuration of its own.
//!
//! | module | idea |
//! | --- | --- |
//! | `robot_session` | a robot's or tool's session and its options ([`SessionConfig`], [`open`]) |
//! | `configuration` | a file and endpoints for Zenoh ([`read_config`], [`set_endpoints`]) |
//! | `waiting` | any configuration as a session, waited for ([`open_configured`]) |
//! | `credentials` | whether certificates and keys can be read and are one's own, checked before connecting |
//! | `expiry` | a certificate that expires while a session is open |
//! | `listen_trouble` | why a session cannot listen where it should |
//! | `trouble` | why nobody answers, in words that name the remedy |
//! | `replacement` | a new session in place of one that routers refuse ([`replacement`]) |
//! | `homecoming` | a new session at the first router, in place of one that came elsewhere ([`homecoming`]) |
//! | `attempt` | one attempt to open a session, off the async threads |
//!
//! Without options the server is looked for on this machine, at `tcp/127.0.0.1:7447`. What cannot
//! be used is an error at once; what may still come is waited for:
//!
//! ```
//! use fht_session::{SessionConfig, open};
//!
//! # let runtime = tokio::runtime::Builder::new_multi_thread().enable_all().build()?;
//! let file = Some("nowhere/zenoh.json5".into());
//! let link = SessionConfig { zenoh_config: file, ..SessionConfig::default() };
//! let error = runtime.block_on(open(&link)).err().map(|error| error.to_string());
//! let refusal = "the Zenoh configuration nowhere/zenoh.json5 is not accepted";
//! assert!(error.is_some_and(|text| text.starts_with(refusal)));
//! # Ok::<(), std::io::Error>(())
//! ```

mod attempt;
mod configuration;
mod credentials;
mod expiry;
mod homecoming;
mod listen_trouble;
mod replacement;
mod robot_session;
mod trouble;
mod waiting;

pub use configuration::{ConfigurationError, WAIT_BEFORE_DROP, read_config, set, set_default, set_endpoints};
pub use credentials::CredentialError;
pub use homecoming::homecoming;
pub use listen_trouble::ListenTrouble;
pub use replacement::{abandon, replacement};
pub use robot_session::{SessionConfig, SessionError, check_owner, check_serving, open, open_within};
pub use trouble::{in_words, without_source_paths};
pub use waiting::{ConnectError, check_server, listening_at, open_configured, remark_while_alone, server_name};
