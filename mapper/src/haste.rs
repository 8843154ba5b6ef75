//! Whether there is time for what makes a map better at its end.

use std::fmt;
use std::sync::Arc;

/// Asked between the last touches of a map, from any thread: when it says that there is no time,
/// the rest of them is left. The map is whole at any time.
#[derive(Clone)]
pub struct Haste(Arc<dyn Fn() -> bool + Send + Sync>);

impl Haste {
    /// There is all the time in the world.
    #[must_use]
    pub fn none() -> Self {
        Self::while_there_is(|| true)
    }

    /// There is time for as long as `has_time` says.
    pub fn while_there_is(has_time: impl Fn() -> bool + Send + Sync + 'static) -> Self {
        Self(Arc::new(has_time))
    }

    /// Whether there is time for more.
    #[must_use]
    pub fn has_time(&self) -> bool {
        (self.0)()
    }
}

impl fmt::Debug for Haste {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Haste").finish_non_exhaustive()
    }
}
