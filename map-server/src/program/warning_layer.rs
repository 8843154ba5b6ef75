//! Shows the warnings of the log to the operators' page.

use crate::web::note_warning;
use std::fmt::{Debug, Write};
use tracing::field::{Field, Visit};
use tracing::level_filters::LevelFilter;
use tracing::{Event, Level, Subscriber};
use tracing_subscriber::Layer;
use tracing_subscriber::filter::Targets;
use tracing_subscriber::layer::Context;
use tracing_subscriber::registry::LookupSpan;

/// The layer: warnings of this program, errors of Zenoh, as the log has them.
pub(super) fn warning_layer<S: Subscriber + for<'a> LookupSpan<'a>>() -> impl Layer<S> {
    Noting.with_filter(Targets::new().with_default(LevelFilter::WARN).with_target("zenoh", LevelFilter::ERROR))
}

struct Noting;

/// The text of a line, and what it is about.
#[derive(Default)]
struct LineText {
    message: String,
    about: String,
}

impl Visit for LineText {
    fn record_debug(&mut self, field: &Field, value: &dyn Debug) {
        // To a text, which cannot fail.
        let _ = match field.name() {
            "message" => write!(self.message, "{value:?}"),
            name => write!(self.about, " {name}={value:?}"),
        };
    }
}

impl<S: Subscriber> Layer<S> for Noting {
    fn on_event(&self, event: &Event<'_>, _: Context<'_, S>) {
        let mut line = LineText::default();
        event.record(&mut line);
        let text = format!("{}{}", line.message, line.about);
        note_warning(*event.metadata().level() == Level::ERROR, &fht_session::without_source_paths(&text));
    }
}
