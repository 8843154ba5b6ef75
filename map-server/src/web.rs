//! The operators' page of a running server, on the server's own session and in its own rooms.
//!
//! | module | idea |
//! | --- | --- |
//! | `side` | starts it, and ends it with the server |
//! | `port` | what the page asks and orders, passed on |
//! | `edit` | what an operator changes, as operations |
//! | `walls` | what nodes saw, as points |
//! | `past` | an earlier state of a map |
//! | `preview` | which paths would be others after a change |
//! | `last_warnings` | the last warnings of the log |
//! | `feed` | what happens, as events |
//! | `growth` | what has changed on a map since it was shown last |

mod edit;
mod feed;
mod growth;
mod last_warnings;
mod past;
mod port;
mod preview;
mod side;
mod walls;

#[cfg(feature = "program")]
pub(crate) use last_warnings::note_warning;
pub(crate) use side::WebSide;
