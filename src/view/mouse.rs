//! State of the mouse between events: its position and the current drag.

use winit::event::{ElementState, MouseButton};

/// Largest distance, in pixels, that the mouse may move while a button is down for the press to count as a click. A
/// longer way is a drag.
const CLICK_PX: f64 = 3.0;

/// Effect of a drag.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Drag {
    /// Moves the camera around its target.
    Orbit,
    /// Turns the camera about its eye.
    Look,
    /// Moves the camera sideways, up and down.
    Pan,
}

impl Drag {
    /// Returns the drag that a button begins, or none if it begins none.
    fn of(button: MouseButton, is_shifted: bool) -> Option<Self> {
        match button {
            MouseButton::Left if is_shifted => Some(Self::Pan),
            MouseButton::Left => Some(Self::Orbit),
            MouseButton::Right => Some(Self::Look),
            MouseButton::Middle => Some(Self::Pan),
            _ => None,
        }
    }
}

/// A mouse button that is down.
#[derive(Clone, Copy, Debug)]
struct Press {
    button: MouseButton,
    /// Position of the mouse when the button went down, pixels.
    start: (f64, f64),
    was_dragged: bool,
    drag: Option<Drag>,
}

/// Position of the mouse, and the first of its buttons that went down.
#[derive(Debug, Default)]
pub struct Mouse {
    /// Pixels from the window's upper left corner.
    cursor: (f64, f64),
    press: Option<Press>,
}

impl Mouse {
    /// Handles a motion to a point in pixels. During a drag, returns the drag and the motion to the right and down,
    /// in heights of the window. `window` is the window's size in pixels.
    pub fn moves(&mut self, to: (f64, f64), window: (u32, u32)) -> Option<(Drag, (f32, f32))> {
        let from = std::mem::replace(&mut self.cursor, to);
        let press = self.press.as_mut()?;
        press.was_dragged |= (to.0 - press.start.0).hypot(to.1 - press.start.1) > CLICK_PX;
        let drag = press.drag.filter(|_| press.was_dragged)?;
        Some((drag, in_heights((to.0 - from.0, to.1 - from.1), window)))
    }

    /// Handles a button that goes down or up. Returns the position of a click of the left button, in pixels.
    pub fn button(&mut self, state: ElementState, button: MouseButton, is_shifted: bool) -> Option<(f64, f64)> {
        match (state, self.press) {
            (ElementState::Pressed, None) => {
                let drag = Drag::of(button, is_shifted);
                self.press = Some(Press { button, start: self.cursor, was_dragged: false, drag });
                None
            }
            (ElementState::Released, Some(press)) if press.button == button => {
                self.press = None;
                (button == MouseButton::Left && !press.was_dragged).then_some(press.start)
            }
            _ => None,
        }
    }

    /// Forgets the button that is down, because the window has lost the focus.
    pub fn release(&mut self) {
        self.press = None;
    }

    /// Returns the mouse's position in pixels from the window's upper left corner.
    pub fn position(&self) -> (f64, f64) {
        self.cursor
    }

    /// Returns the mouse's offset to the right of the window's middle and below it, in heights of the window.
    pub fn offset_from_middle(&self, window: (u32, u32)) -> (f32, f32) {
        let middle = (f64::from(window.0) / 2.0, f64::from(window.1) / 2.0);
        in_heights((self.cursor.0 - middle.0, self.cursor.1 - middle.1), window)
    }
}

/// Converts pixels to heights of the window.
fn in_heights((x, y): (f64, f64), window: (u32, u32)) -> (f32, f32) {
    let height = f64::from(window.1.max(1));
    ((x / height) as f32, (y / height) as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_are_in_heights_of_the_window() {
        let mut mouse = Mouse::default();
        assert_eq!(mouse.moves((10.0, 10.0), (200, 100)), None);
        assert_eq!(mouse.offset_from_middle((200, 100)), (-0.9, -0.4));
        mouse.button(ElementState::Pressed, MouseButton::Middle, false);
        assert_eq!(mouse.moves((11.0, 10.0), (200, 100)), None, "so little is no drag");
        assert_eq!(mouse.moves((61.0, 35.0), (200, 100)), Some((Drag::Pan, (0.5, 0.25))));
        mouse.release();
        assert_eq!(mouse.moves((0.0, 0.0), (200, 100)), None);
    }
}
