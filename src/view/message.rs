//! Messages to the user: errors that do not close the window, and notes on what has been done.

use std::time::{Duration, Instant};

/// Time for which a note is shown, and for which an error is shown while the panel is hidden.
const SHOWN_FOR: Duration = Duration::from_secs(8);

/// Topic of a message. A later success on the same topic clears an error.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Topic {
    Device,
    Scene,
    Time,
    Shaders,
    Settings,
    File,
}

/// A message that the overlay shows.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Message {
    pub topic: Topic,
    pub text: String,
    pub is_error: bool,
    /// When the message arose.
    at: Instant,
}

impl Message {
    /// Creates the message of an error.
    pub fn error(topic: Topic, text: &str) -> Self {
        Self { topic, text: text.to_owned(), is_error: true, at: Instant::now() }
    }

    /// Creates a note on what is being done or has been done.
    pub fn note(topic: Topic, text: &str) -> Self {
        Self { is_error: false, ..Self::error(topic, text) }
    }

    /// Returns the time for which the message is still shown outside the panel; none once that is over.
    pub fn time_left(&self, now: Instant) -> Option<Duration> {
        SHOWN_FOR.checked_sub(now.duration_since(self.at)).filter(|left| !left.is_zero())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_message_is_shown_for_a_while() {
        let message = Message::note(Topic::File, "wrote x.png");
        assert_eq!(message.time_left(message.at), Some(SHOWN_FOR));
        assert_eq!(message.time_left(message.at + SHOWN_FOR / 2), Some(SHOWN_FOR / 2));
        assert_eq!(message.time_left(message.at + SHOWN_FOR), None);
        assert_eq!(message.time_left(message.at + 2 * SHOWN_FOR), None);
    }
}
