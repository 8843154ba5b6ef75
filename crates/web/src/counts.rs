//! What is counted of HTTP. Labels are those of fixed lists.

use axum::http::StatusCode;
use fht_door::DoorCounts;
use prometheus_client::metrics::counter::Counter;
use prometheus_client::metrics::family::Family;
use prometheus_client::metrics::gauge::Gauge;

/// What is counted of HTTP.
#[derive(Debug, Default)]
pub(crate) struct WebCounts {
    pub(crate) requests: Family<[(&'static str, &'static str); 2], Counter>,
    pub(crate) connections: Gauge,
    pub(crate) refused_connections: Counter,
    pub(crate) streams: Gauge,
}

impl DoorCounts for WebCounts {
    fn opened(&self) {
        self.connections.inc();
    }

    fn closed(&self) {
        self.connections.dec();
    }

    fn refused(&self) {
        self.refused_connections.inc();
    }
}

impl WebCounts {
    pub(crate) fn request(&self, route: &'static str, status: StatusCode) {
        let class = match status.as_u16() / 100 {
            2 => "2xx",
            3 => "3xx",
            4 => "4xx",
            _ => "5xx",
        };
        self.requests.get_or_create(&[("route", route), ("status", class)]).inc();
    }

    pub(crate) fn streams(&self, change: i64) {
        self.streams.inc_by(change);
    }
}

/// The kind of address that a path is, of a fixed list.
pub(crate) fn route_of(path: &str) -> &'static str {
    let mut chunks = path.split('/').skip(1);
    match (chunks.next(), chunks.next()) {
        (Some("" | "page"), _) => "page",
        (Some("fht"), _) => "ask",
        (Some("metrics"), None) => "metrics",
        (Some("api"), Some("events")) => "events",
        (Some("api"), Some("change")) => "change",
        (Some("api"), Some("preview")) => "preview",
        (Some("api"), Some("past")) => "past",
        (Some("api"), Some("warnings")) => "warnings",
        (Some("api"), Some("walls")) => "walls",
        (Some("api"), Some("me")) => "me",
        _ => "other",
    }
}
