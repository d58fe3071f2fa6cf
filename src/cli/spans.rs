//! A timeline of the CPU's work: the library's tracing spans, kept for `--trace`.

use std::{
    sync::{Arc, Mutex, PoisonError},
    time::Instant,
};

use tracing::{Subscriber, span};
use tracing_subscriber::{
    Layer,
    filter::{FilterFn, LevelFilter},
    layer::Context,
    registry::LookupSpan,
};

/// A named piece of work and its time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Span {
    pub name: &'static str,
    pub begin: Instant,
    pub end: Instant,
}

/// Collects spans as they end. Clones share what they collect.
#[derive(Clone, Default)]
pub struct Spans(Arc<Mutex<Vec<Span>>>);

impl Spans {
    /// Returns the layer that collects kdray's own spans. It ignores events and other libraries' spans.
    pub fn layer<S>(&self) -> impl Layer<S> + use<S>
    where
        S: Subscriber + for<'a> LookupSpan<'a>,
    {
        let is_own = |metadata: &tracing::Metadata| metadata.is_span() && metadata.target().starts_with("kdray");
        Collector(self.clone()).with_filter(FilterFn::new(is_own).with_max_level_hint(LevelFilter::INFO))
    }

    /// Returns all spans so far, sorted by start time. A span comes before those that it encloses.
    pub fn sorted(&self) -> Vec<Span> {
        let mut spans = self.0.lock().unwrap_or_else(PoisonError::into_inner).clone();
        spans.sort_by(|a, b| a.begin.cmp(&b.begin).then(b.end.cmp(&a.end)));
        spans
    }
}

struct Collector(Spans);

impl<S> Layer<S> for Collector
where
    S: Subscriber + for<'a> LookupSpan<'a>,
{
    fn on_enter(&self, id: &span::Id, context: Context<'_, S>) {
        if let Some(span) = context.span(id) {
            span.extensions_mut().replace(Instant::now());
        }
    }

    fn on_exit(&self, id: &span::Id, context: Context<'_, S>) {
        let end = Instant::now();
        let Some(span) = context.span(id) else { return };
        let Some(begin) = span.extensions_mut().remove::<Instant>() else { return };
        self.0.0.lock().unwrap_or_else(PoisonError::into_inner).push(Span { name: span.name(), begin, end });
    }
}

#[cfg(test)]
mod tests {
    use tracing::{info, info_span, subscriber};
    use tracing_subscriber::{Registry, layer::SubscriberExt};

    use super::*;

    #[test]
    fn spans_are_kept_with_those_around_them_first() {
        let spans = Spans::default();
        subscriber::with_default(Registry::default().with(spans.layer()), || {
            info_span!("outer").in_scope(|| {
                info!("an event");
                info_span!("inner").in_scope(|| {});
                info_span!(target: "another crate", "foreign").in_scope(|| {});
            });
            info_span!("next").in_scope(|| {});
        });
        let [outer, inner, next] = spans.sorted()[..] else { panic!("three spans") };
        assert_eq!([outer, inner, next].map(|span| span.name), ["outer", "inner", "next"]);
        assert!(outer.begin <= inner.begin && inner.end <= outer.end && outer.end <= next.begin);
    }
}
