//! What every request must pass before it is answered.
//!
//! A browser sends a certificate on its own, whoever has asked it to send a request, and a name
//! that a stranger owns may lead to this machine. So requests must be for one of the own names, and
//! changes must come from the own page, or from a program that is no browser.

use crate::counts::route_of;
use crate::reply::WebRefusal;
use crate::rights::Rights;
use crate::site::Site;
use crate::visitor::Visitor;
use axum::Extension;
use axum::extract::{Request, State};
use axum::http::header::{CONTENT_SECURITY_POLICY, CONTENT_TYPE, HOST, ORIGIN, REFERRER_POLICY};
use axum::http::header::{X_CONTENT_TYPE_OPTIONS, X_FRAME_OPTIONS};
use axum::http::{HeaderMap, HeaderName, HeaderValue, Method, StatusCode};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use fht_door::Hosts;
use fht_proto::api::reply::ErrorCode;
use std::sync::Arc;

/// Only what lies here is shown and run, and nobody shows it in a frame of their own.
const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; \
                      connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

const SEC_FETCH_SITE: HeaderName = HeaderName::from_static("sec-fetch-site");
const SEC_FETCH_MODE: HeaderName = HeaderName::from_static("sec-fetch-mode");

/// What is judged of a request.
struct Asked<'a> {
    method: &'a Method,
    path: &'a str,
    headers: &'a HeaderMap,
}

impl Asked<'_> {
    /// A field that is there once, as text.
    fn field(&self, name: &HeaderName) -> Result<Option<&str>, WebRefusal> {
        let mut values = self.headers.get_all(name).iter();
        let value = values.next().map(HeaderValue::to_str);
        match (value, values.next()) {
            (None, _) => Ok(None),
            (Some(Ok(text)), None) => Ok(Some(text)),
            _ => Err(bad(StatusCode::BAD_REQUEST, &format!("the field {name} cannot be read"))),
        }
    }

    fn is_from_own_page(&self, host: &str, scheme: &str) -> Result<(), WebRefusal> {
        let elsewhere = |what: &str| forbidden(&format!("this request comes from another site ({what})"));
        match self.field(&SEC_FETCH_SITE)? {
            None | Some("same-origin") => {}
            Some(_) => return Err(elsewhere("Sec-Fetch-Site")),
        }
        match self.field(&ORIGIN)? {
            Some(origin) if origin != format!("{scheme}://{host}") => Err(elsewhere("Origin")),
            _ => Ok(()),
        }
    }

    /// Links to the page may stand anywhere; what it is made of is asked for by itself, or typed.
    fn may_look_from_there(&self) -> Result<(), WebRefusal> {
        let is_link = self.path == "/" && self.field(&SEC_FETCH_MODE)? == Some("navigate");
        match self.field(&SEC_FETCH_SITE)? {
            None | Some("same-origin" | "none") => Ok(()),
            Some(_) if is_link => Ok(()),
            Some(_) => Err(forbidden("this request comes from another site (Sec-Fetch-Site)")),
        }
    }

    fn judge(&self, visitor: &Visitor, rights: Rights, hosts: &Hosts) -> Result<(), WebRefusal> {
        if *visitor == Visitor::Stranger {
            let text = "show a certificate of this site whose common name is ROLE:NAME";
            return Err(WebRefusal::new(StatusCode::UNAUTHORIZED, ErrorCode::NotPermitted, text));
        }
        if rights == Rights::Nothing {
            return Err(forbidden("the list of roles has nobody of this role and name"));
        }
        let Some(host) = self.field(&HOST)? else { return Err(bad(StatusCode::BAD_REQUEST, "a field Host is needed")) };
        if !hosts.has(host) {
            let text = "this server does not go by the name in the field Host: --web-name makes one known";
            return Err(bad(StatusCode::MISDIRECTED_REQUEST, text));
        }
        match *self.method {
            Method::GET | Method::HEAD => self.may_look_from_there(),
            Method::POST => {
                self.is_from_own_page(host, hosts.scheme())?;
                let kind = self.field(&CONTENT_TYPE)?.unwrap_or_default();
                let is_json = kind.split(';').next().is_some_and(|kind| kind.trim() == "application/json");
                if !is_json {
                    let text = "a change is JSON: Content-Type: application/json";
                    return Err(bad(StatusCode::UNSUPPORTED_MEDIA_TYPE, text));
                }
                match rights {
                    Rights::Change => Ok(()),
                    Rights::Nothing | Rights::Look => Err(forbidden("only operators change maps")),
                }
            }
            _ => Err(bad(StatusCode::METHOD_NOT_ALLOWED, "GET and POST are answered, and nothing else")),
        }
    }
}

fn bad(status: StatusCode, message: &str) -> WebRefusal {
    WebRefusal::new(status, ErrorCode::BadRequest, message)
}

fn forbidden(message: &str) -> WebRefusal {
    WebRefusal::new(StatusCode::FORBIDDEN, ErrorCode::NotPermitted, message)
}

/// Lets a request through, or tells why not.
pub(crate) async fn guard(
    State(site): State<Arc<Site>>,
    Extension(visitor): Extension<Visitor>,
    request: Request,
    next: Next,
) -> Response {
    let asked = Asked { method: request.method(), path: request.uri().path(), headers: request.headers() };
    let judged = asked.judge(&visitor, site.rights(&visitor), site.hosts());
    let route = route_of(asked.path);
    let mut response = match judged {
        Ok(()) => next.run(request).await,
        Err(refused) => {
            tracing::info!(status = refused.status.as_u16(), "a request over HTTP is refused: {}", refused.reply);
            refused.into_response()
        }
    };
    site.counts().request(route, response.status());
    for (name, value) in [
        (CONTENT_SECURITY_POLICY, POLICY),
        (X_CONTENT_TYPE_OPTIONS, "nosniff"),
        (REFERRER_POLICY, "no-referrer"),
        (X_FRAME_OPTIONS, "DENY"),
        (HeaderName::from_static("cross-origin-resource-policy"), "same-origin"),
        (HeaderName::from_static("cross-origin-opener-policy"), "same-origin"),
    ] {
        response.headers_mut().insert(name, HeaderValue::from_static(value));
    }
    response
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::net::IpAddr;

    fn hosts() -> Hosts {
        Hosts::new(IpAddr::from([10, 0, 0, 5]), ["Maps.Example".to_owned()].into_iter(), true)
    }

    fn judged(method: &Method, path: &str, rights: Rights, fields: &[(&'static str, &'static str)]) -> u16 {
        let fields =
            fields.iter().map(|(name, value)| (HeaderName::from_static(name), HeaderValue::from_static(value)));
        let headers: HeaderMap = fields.collect();
        let asked = Asked { method, path, headers: &headers };
        asked.judge(&Visitor::Local(None), rights, &hosts()).map_or_else(|refused| refused.status.as_u16(), |()| 200)
    }

    #[test]
    fn only_own_names_are_answered() {
        for (host, status) in [
            ("localhost:8080", 200),
            ("127.0.0.1", 200),
            ("[::1]:8443", 200),
            ("[::1]", 200),
            ("10.0.0.5:8443", 200),
            ("MAPS.example:8443", 200),
            ("evil.example", 421),
            ("localhost.evil.example", 421),
            ("10.0.0.6", 421),
            ("", 421),
        ] {
            assert_eq!(judged(&Method::GET, "/", Rights::Look, &[("host", host)]), status, "{host}");
        }
        assert_eq!(judged(&Method::GET, "/", Rights::Look, &[]), 400);
    }

    #[test]
    fn changes_come_from_the_own_page_or_from_programs() {
        let post = |rights, more: &[(&'static str, &'static str)]| {
            judged(&Method::POST, "/api/change/m", rights, &[&[("host", "maps.example:8443")], more].concat())
        };
        let json = ("content-type", "application/json; charset=utf-8");
        let origin = ("origin", "https://maps.example:8443");
        assert_eq!(post(Rights::Change, &[json]), 200, "curl");
        assert_eq!(post(Rights::Change, &[json, origin, ("sec-fetch-site", "same-origin")]), 200);
        assert_eq!(post(Rights::Look, &[json]), 403);
        assert_eq!(post(Rights::Change, &[]), 415);
        assert_eq!(post(Rights::Change, &[("content-type", "text/plain")]), 415);
        for site in ["cross-site", "same-site", "none", "odd"] {
            assert_eq!(post(Rights::Change, &[json, origin, ("sec-fetch-site", site)]), 403, "{site}");
        }
        for origin in ["https://evil.example", "null", "http://maps.example:8443", "https://maps.example"] {
            assert_eq!(post(Rights::Change, &[json, ("origin", origin)]), 403, "{origin}");
        }
    }

    #[test]
    fn who_looks_comes_by_a_link_to_the_page_alone() {
        let get = |path, more: &[(&'static str, &'static str)]| {
            judged(&Method::GET, path, Rights::Look, &[&[("host", "localhost")], more].concat())
        };
        let (far, link) = (("sec-fetch-site", "cross-site"), ("sec-fetch-mode", "navigate"));
        assert_eq!((get("/", &[far, link]), get("/", &[far])), (200, 403));
        assert_eq!((get("/fht/maps", &[far, link]), get("/fht/maps", &[("sec-fetch-site", "none")])), (403, 200));
        assert_eq!(judged(&Method::DELETE, "/", Rights::Change, &[("host", "localhost")]), 405);
        assert_eq!(judged(&Method::GET, "/", Rights::Nothing, &[("host", "localhost")]), 403);
    }
}
