//! All figures in Prometheus' text form. Labels are those of fixed lists, and the names of maps, of
//! which there are so many at most.

use crate::counts::WebCounts;
use crate::figures::{MapGauges, QueryFigures};
use crate::port::MapPort;
use prometheus_client::collector::Collector;
use prometheus_client::encoding::prometheus_text;
use prometheus_client::encoding::{DescriptorEncoder, EncodeMetric, NoLabelSet};
use prometheus_client::metrics::MetricType;
use prometheus_client::metrics::counter::ConstCounter;
use prometheus_client::metrics::gauge::ConstGauge;
use prometheus_client::registry::Registry;
use std::fmt;
use std::sync::Arc;

/// Maps that are told of, as many as a server has unless told otherwise.
const MAX_MAPS: usize = 256;

/// A server's figures as a collector.
struct Counted(Arc<dyn MapPort>);

impl fmt::Debug for Counted {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Counted")
    }
}

fn signed(count: impl TryInto<i64>) -> i64 {
    count.try_into().unwrap_or(i64::MAX)
}

impl Collector for Counted {
    fn encode(&self, mut encoder: DescriptorEncoder<'_>) -> fmt::Result {
        let figures = self.0.figures();
        let maps = &figures.maps[..figures.maps.len().min(MAX_MAPS)];
        encode_maps(&mut encoder, maps)?;
        let read_only = ConstGauge::new(i64::from(figures.is_read_only));
        let help = "Whether the server's disk takes nothing.";
        read_only.encode(encoder.encode_descriptor("fht_server_read_only", help, None, MetricType::Gauge)?)?;
        if let Some(bytes) = figures.disk_free_bytes {
            let free = ConstGauge::new(signed(bytes));
            let help = "Room left on the disk that the maps are kept on.";
            free.encode(encoder.encode_descriptor("fht_server_disk_free_bytes", help, None, MetricType::Gauge)?)?;
        }
        let help = "Zenoh sessions that are connected to the server.";
        let mut sessions = encoder.encode_descriptor("fht_zenoh_sessions", help, None, MetricType::Gauge)?;
        for (kind, count) in &figures.sessions {
            ConstGauge::new(signed(*count)).encode(sessions.encode_family(&[("kind", *kind)])?)?;
        }
        let help = "Warnings and errors in the server's log.";
        let mut lines = encoder.encode_descriptor("fht_log_lines", help, None, MetricType::Counter)?;
        for (level, count) in [("warning", figures.warnings), ("error", figures.errors)] {
            ConstCounter::new(count).encode(lines.encode_family(&[("level", level)])?)?;
        }
        encode_queries(&mut encoder, &figures.queries)
    }
}

fn encode_maps(encoder: &mut DescriptorEncoder<'_>, maps: &[MapGauges]) -> fmt::Result {
    type Read = fn(&MapGauges) -> i64;
    let gauges: [(&str, &str, Read); 6] = [
        ("fht_map_version", "Increments that the map has.", |map| signed(map.version)),
        ("fht_map_main_nodes", "Main nodes that are shown.", |map| signed(map.main_nodes)),
        ("fht_map_support_nodes", "Support nodes that are shown.", |map| signed(map.support_nodes)),
        ("fht_map_edges", "Edges that are shown.", |map| signed(map.edges)),
        ("fht_map_robots", "Robots that are there.", |map| signed(map.robots)),
        ("fht_map_late_robots", "Robots that have lacked something for too long.", |map| signed(map.late_robots)),
    ];
    for (name, help, read) in gauges {
        let mut metric = encoder.encode_descriptor(name, help, None, MetricType::Gauge)?;
        for map in maps {
            ConstGauge::new(read(map)).encode(metric.encode_family(&[("map", map.map.as_str())])?)?;
        }
    }
    let help = "Bytes of all increments of the map as they travelled.";
    let mut metric = encoder.encode_descriptor("fht_map_size_bytes", help, None, MetricType::Gauge)?;
    for map in maps {
        ConstGauge::new(signed(map.bytes)).encode(metric.encode_family(&[("map", map.map.as_str())])?)?;
    }
    let help = "Increments refused since the server started.";
    let mut metric = encoder.encode_descriptor("fht_map_refused_increments", help, None, MetricType::Counter)?;
    for map in maps {
        ConstCounter::new(map.refused).encode(metric.encode_family(&[("map", map.map.as_str())])?)?;
    }
    Ok(())
}

fn encode_queries(encoder: &mut DescriptorEncoder<'_>, queries: &[QueryFigures]) -> fmt::Result {
    let help = "Questions by what is asked and what came of them, over Zenoh and HTTP.";
    let mut metric = encoder.encode_descriptor("fht_queries", help, None, MetricType::Counter)?;
    for of in queries {
        for (outcome, count) in [("answered", of.answered), ("refused", of.refused), ("busy", of.busy)] {
            let labels = [("topic", of.topic), ("outcome", outcome)];
            ConstCounter::new(count).encode(metric.encode_family(&labels)?)?;
        }
    }
    let help = "How long questions took from when they came.";
    let mut metric = encoder.encode_descriptor("fht_query_duration_seconds", help, None, MetricType::Histogram)?;
    for of in queries {
        let count = of.buckets.iter().map(|(_, count)| count).sum();
        metric.encode_family(&[("topic", of.topic)])?.encode_histogram::<NoLabelSet>(
            of.seconds,
            count,
            &of.buckets,
            None,
        )?;
    }
    Ok(())
}

/// The type of [`exposition`].
pub(crate) const EXPOSITION_TYPE: &str = prometheus_text::CONTENT_TYPE;

/// All figures as text.
///
/// # Errors
/// None that is known: the text is made in memory.
pub(crate) fn exposition(counts: &WebCounts, port: Arc<dyn MapPort>) -> Result<String, fmt::Error> {
    let mut registry = Registry::default();
    let WebCounts { requests, connections, refused_connections, streams } = counts;
    registry.register("fht_http_requests", "Requests over HTTP by address and status", requests.clone());
    registry.register("fht_http_connections", "Connections over HTTP", connections.clone());
    let help = "Connections closed at once because there were too many";
    registry.register("fht_http_refused_connections", help, refused_connections.clone());
    registry.register("fht_http_event_streams", "Streams of events", streams.clone());
    registry.register_collector(Box::new(Counted(port)));
    let mut text = String::new();
    prometheus_text::encode(&mut text, &registry)?;
    Ok(text)
}
