//! The page: files as they are, for there is nothing to build.

use crate::reply::{WebRefusal, with_type};
use axum::extract::Path;
use axum::http::header::CACHE_CONTROL;
use axum::http::{HeaderValue, StatusCode};
use axum::response::Response;
use fht_proto::api::reply::ErrorCode;

const SCRIPT: &str = "text/javascript; charset=utf-8";

macro_rules! files {
    ($($name:literal: $kind:expr),* $(,)?) => {
        &[$(($name, $kind, include_bytes!(concat!("../page/", $name)).as_slice())),*]
    };
}

const FILES: &[(&str, &str, &[u8])] = files! {
    "style.css": "text/css; charset=utf-8",
    "icon.svg": "image/svg+xml",
    "main.js": SCRIPT,
    "api.js": SCRIPT,
    "dom.js": SCRIPT,
    "figures.js": SCRIPT,
    "geometry.js": SCRIPT,
    "compare.js": SCRIPT,
    "live.js": SCRIPT,
    "map_list.js": SCRIPT,
    "health.js": SCRIPT,
    "map_store.js": SCRIPT,
    "map_page.js": SCRIPT,
    "view.js": SCRIPT,
    "pen.js": SCRIPT,
    "still.js": SCRIPT,
    "draw.js": SCRIPT,
    "tools.js": SCRIPT,
    "forms.js": SCRIPT,
    "path_panel.js": SCRIPT,
    "change_panel.js": SCRIPT,
    "journal_panel.js": SCRIPT,
    "release_panel.js": SCRIPT,
    "time_panel.js": SCRIPT,
    "about_panels.js": SCRIPT,
    "plan_panel.js": SCRIPT,
    "earth_panel.js": SCRIPT,
};

fn file_with(kind: &'static str, bytes: &'static [u8]) -> Response {
    let mut response = with_type(kind, bytes);
    // A newer server brings a newer page.
    response.headers_mut().insert(CACHE_CONTROL, HeaderValue::from_static("no-cache"));
    response
}

/// The page itself.
pub(crate) async fn index() -> Response {
    file_with("text/html; charset=utf-8", include_bytes!("../page/index.html"))
}

/// What it consists of.
pub(crate) async fn file(Path(asked): Path<String>) -> Result<Response, WebRefusal> {
    let found = FILES.iter().find(|(name, ..)| *name == asked);
    let missing = || WebRefusal::new(StatusCode::NOT_FOUND, ErrorCode::BadRequest, "the page has no such file");
    found.map(|(_, kind, bytes)| file_with(kind, bytes)).ok_or_else(missing)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text(bytes: &[u8]) -> String {
        String::from_utf8_lossy(bytes).into_owned()
    }

    #[test]
    fn nothing_in_the_page_runs_inline_or_makes_markup_of_names() {
        let index = text(include_bytes!("../page/index.html"));
        assert!(!index.contains("style=\"") && !index.contains("onclick"), "{index}");
        assert_eq!(index.matches("<script").count(), index.matches("<script type=\"module\" src=\"/page/").count());
        for (name, kind, bytes) in FILES {
            let code = text(bytes);
            for markup in
                ["innerHTML", "outerHTML", "insertAdjacentHTML", "document.write", "eval(", "new Function", ".style ="]
            {
                assert!(*kind != SCRIPT || !code.contains(markup), "{name}: {markup}");
            }
        }
    }

    #[test]
    fn every_module_that_is_imported_is_there() {
        for (name, _, bytes) in FILES {
            for part in text(bytes).split(" from \"./").skip(1) {
                let imported = part.split('"').next().unwrap_or_default();
                assert!(FILES.iter().any(|(known, ..)| *known == imported), "{name} imports {imported}");
            }
        }
    }
}
