//! Traces of queries, sent to a collector of OpenTelemetry: OTLP over plain HTTP, in batches, by a
//! thread of their own. A collector that is slow or away costs spans, and never an answer.

use http_body_util::{BodyExt, Full, Limited};
use hyper::client::conn::http1::handshake;
use hyper::header::{HOST, HeaderValue};
use hyper_util::rt::TokioIo;
use opentelemetry::global;
use opentelemetry_http::{Bytes, HttpClient, HttpError, Request, Response};
use opentelemetry_otlp::{
    OTEL_EXPORTER_OTLP_ENDPOINT, OTEL_EXPORTER_OTLP_TRACES_ENDPOINT, Protocol, SpanExporter as OtlpExporter,
    WithExportConfig, WithHttpConfig,
};
use opentelemetry_sdk::Resource;
use opentelemetry_sdk::error::OTelSdkResult;
use opentelemetry_sdk::trace::{SdkTracerProvider, SpanData, SpanExporter};
use std::pin::Pin;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::Duration;
use tokio::net::TcpStream;
use tokio::runtime::Handle;
use tokio::time::timeout;

/// How long a collector may take for a batch.
const SENDING: Duration = Duration::from_secs(10);
/// How long the last spans may take when the server ends.
const LAST_SPANS: Duration = Duration::from_millis(500);
/// Longest reply of a collector, bytes.
const MAX_REPLY: usize = 64 << 10;

/// The export, until it is dropped.
pub(super) struct TraceExport(Option<SdkTracerProvider>);

impl TraceExport {
    /// Exports if the environment says where to (`OTEL_EXPORTER_OTLP_ENDPOINT`), on the threads of
    /// `runtime`. What is wrong with that is told in the log, and the server serves all the same.
    pub(super) fn start(runtime: &Handle) -> Self {
        let is_set = |name: &&str| std::env::var_os(name).is_some_and(|value| !value.is_empty());
        let is_off = std::env::var("OTEL_SDK_DISABLED").is_ok_and(|value| value.eq_ignore_ascii_case("true"));
        let named = [OTEL_EXPORTER_OTLP_TRACES_ENDPOINT, OTEL_EXPORTER_OTLP_ENDPOINT];
        let Some(named) = named.iter().find(|name| is_set(name)).filter(|_| !is_off) else { return Self(None) };
        if std::env::var(named).is_ok_and(|endpoint| !endpoint.starts_with("http://")) {
            tracing::warn!("traces are not exported: {named} must begin with http://, such as http://127.0.0.1:4318");
            return Self(None);
        }
        let client = PlainHttp { runtime: runtime.clone() };
        let exporter =
            OtlpExporter::builder().with_http().with_http_client(client).with_protocol(Protocol::HttpBinary).build();
        let exporter = match exporter {
            Ok(exporter) => TellingExporter { exporter, is_told: AtomicBool::new(false) },
            Err(error) => {
                tracing::warn!("traces are not exported: {error}");
                return Self(None);
            }
        };
        let provider = SdkTracerProvider::builder().with_batch_exporter(exporter).with_resource(resource()).build();
        global::set_tracer_provider(provider.clone());
        Self(Some(provider))
    }
}

/// Who says all this; `OTEL_SERVICE_NAME` goes before our name.
fn resource() -> Resource {
    let named = std::env::var_os("OTEL_SERVICE_NAME").is_some_and(|name| !name.is_empty());
    let builder = Resource::builder();
    if named { builder.build() } else { builder.with_service_name("map-server").build() }
}

impl Drop for TraceExport {
    fn drop(&mut self) {
        if let Some(provider) = &self.0 {
            // What does not get there is lost, as it would be at any other time.
            let _ = provider.shutdown_with_timeout(LAST_SPANS);
        }
    }
}

/// An exporter that says once that it cannot.
#[derive(Debug)]
struct TellingExporter {
    exporter: OtlpExporter,
    is_told: AtomicBool,
}

impl SpanExporter for TellingExporter {
    async fn export(&self, batch: Vec<SpanData>) -> OTelSdkResult {
        let outcome = self.exporter.export(batch).await;
        if let Err(error) = &outcome
            && !self.is_told.swap(true, Relaxed)
        {
            tracing::warn!("traces do not reach their collector, and are dropped while that is so: {error}");
        }
        outcome
    }

    fn shutdown_with_timeout(&self, timeout: Duration) -> OTelSdkResult {
        self.exporter.shutdown_with_timeout(timeout)
    }

    fn force_flush(&self) -> OTelSdkResult {
        self.exporter.force_flush()
    }

    fn set_resource(&mut self, resource: &Resource) {
        self.exporter.set_resource(resource);
    }
}

/// HTTP/1.1 without TLS, a connection for each batch.
#[derive(Debug)]
struct PlainHttp {
    /// Whoever exports waits in a thread that is none of this runtime's.
    runtime: Handle,
}

impl HttpClient for PlainHttp {
    fn send_bytes<'life0, 'async_trait>(
        &'life0 self,
        request: Request<Bytes>,
    ) -> Pin<Box<dyn Future<Output = Result<Response<Bytes>, HttpError>> + Send + 'async_trait>>
    where
        'life0: 'async_trait,
        Self: 'async_trait,
    {
        let sent = self.runtime.spawn(async move { timeout(SENDING, post(request)).await });
        Box::pin(async move { sent.await?? })
    }
}

async fn post(request: Request<Bytes>) -> Result<Response<Bytes>, HttpError> {
    let (mut head, body) = request.into_parts();
    let authority = head.uri.authority().ok_or("the endpoint names no host")?.clone();
    let (host, port) = (authority.host(), authority.port_u16().unwrap_or(80));
    let stream = TcpStream::connect((host.trim_matches(['[', ']']), port)).await?;
    let (mut sender, connection) = handshake(TokioIo::new(stream)).await?;
    let driven = tokio::spawn(connection);
    head.headers.insert(HOST, HeaderValue::from_str(authority.as_str())?);
    head.uri = head.uri.path_and_query().map_or("/", |path| path.as_str()).parse()?;
    let response = sender.send_request(Request::from_parts(head, Full::new(body))).await?;
    let (head, body) = response.into_parts();
    let body = Limited::new(body, MAX_REPLY).collect().await?.to_bytes();
    driven.abort();
    Ok(Response::from_parts(head, body))
}
