//! The operators' page and the HTTP interface under it, before a map server.
//!
//! ```text
//! browser, curl ─→ fht-door ─→ connections ─→ guard ─→ routes ─→ MapPort ─→ the server's own rooms
//!                  TLS, bounds  HTTP          who may  /fht …
//!                                            do what  events ←─ EventHub ←─ what the server hears
//! ```
//!
//! The same selectors are asked as over Zenoh, `GET /fht/museum/path?from=0,0;to=dock`, and the
//! same replies come. The library has no maps and no Zenoh: whoever has them implements
//! [`MapPort`], and puts what happens into an [`EventHub`].
//!
//! | module | idea |
//! | --- | --- |
//! | `config` | where it listens, who is let in, how much is taken |
//! | `listener` | a socket that is bound, and serving on it |
//! | `connections` | HTTP on connections that were let in |
//! | `visitor` | who is on the other end, and what that one may do |
//! | `rights` | … in words |
//! | `guard` | what every request must pass before it is answered |
//! | `site` | what all requests share |
//! | `routes` | addresses to questions |
//! | `parameters` | the parameters of a query, as Zenoh writes them or as browsers do |
//! | `change` | what operators change |
//! | `reply` | answers and refusals as HTTP |
//! | `events` | server-sent events: streams that are bounded and dropped when they do not read |
//! | `page` | the page |
//! | `figures` | what a server has counted |
//! | `counts` | what is counted of HTTP |
//! | `exposition` | all of it in Prometheus' form |
//! | `port` | what the maps are asked through |
//!
//! Who listens beyond this machine needs certificates:
//!
//! ```
//! use fht_web::{WebConfig, WebError, WebListener};
//!
//! let exposed = WebConfig::at("0.0.0.0:8080".parse()?);
//! assert!(matches!(WebListener::bind(&exposed), Err(WebError::Exposed { .. })));
//!
//! let here = WebListener::bind(&WebConfig::at("127.0.0.1:0".parse()?))?;
//! assert!(here.url().starts_with("http://127.0.0.1:"));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod change;
mod config;
mod connections;
mod counts;
mod events;
mod exposition;
mod figures;
mod guard;
mod listener;
mod page;
mod parameters;
mod port;
mod reply;
mod rights;
mod routes;
mod site;
mod visitor;

pub use change::{MapChange, MapChangeOrder};
pub use config::{WebConfig, WebError, WebLimits};
pub use events::{EventHub, WebEvent};
pub use fht_door::{DoorCertificates, MemberRole};
pub use figures::{MapGauges, QueryFigures, ServerFigures};
pub use listener::WebListener;
pub use port::{Answering, MapPort, PastQuestion, WallsQuestion, WebAnswer};
pub use rights::Rights;
