//! The operators' page of a running server, on the server's own session and in its own rooms.
//!
//! | module | idea |
//! | --- | --- |
//! | `side` | starts it, and ends it with the server |
//! | `port` | what the page asks and orders, passed on |
//! | `edit` | what an operator changes, as operations |
//! | `walls` | what nodes saw, as points |
//! | `feed` | what happens, as events |
//! | `growth` | what has changed on a map since it was shown last |

mod edit;
mod feed;
mod growth;
mod port;
mod side;
mod walls;

pub(crate) use side::WebSide;
