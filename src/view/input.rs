//! The window's keys and mouse to camera moves and actions.

use winit::{
    event::{ElementState, KeyEvent, MouseButton, MouseScrollDelta, WindowEvent},
    keyboard::{KeyCode, PhysicalKey},
};

use super::{controller::Controller, flight::Fly};
use crate::frame::View;

/// Pixels of the wheel's travel where it has no steps.
const WHEEL_STEP_PX: f64 = 50.0;
/// A press that moves less, in pixels, is a click.
const CLICK_PX: f64 = 3.0;

/// What the user wants done, once.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Action {
    Save,
    PrintCamera,
    FrameScene,
    GoHome,
    ToggleOverlay,
    Show(View),
    /// What a place of the window shows, pixels from its upper left corner.
    Pick {
        x: f64,
        y: f64,
    },
    Quit,
}

/// What an event comes to.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Heard {
    pub action: Option<Action>,
    /// Whether the camera moved, or begins to.
    pub moves: bool,
}

/// The mouse between events, and what the keys mean.
#[derive(Debug, Default)]
pub struct Input {
    cursor: (f64, f64),
    /// Of the first button that is down: which, where it went down, whether it was dragged.
    press: Option<(MouseButton, (f64, f64), bool)>,
    /// Whether S flies back: from the first key that flies until the camera is put somewhere or goes round.
    is_flying: bool,
}

impl Input {
    /// Whether S flies back, rather than saves.
    pub fn is_flying(&self) -> bool {
        self.is_flying
    }

    /// Handles an event that is not the overlay's; `height`: the window's, pixels.
    pub fn hear(&mut self, event: &WindowEvent, height: u32, controller: &mut Controller) -> Heard {
        match event {
            // Keys that are down when the window gets them: those pressed since are told of once more.
            WindowEvent::KeyboardInput { event, is_synthetic: true, .. } if event.state.is_pressed() => {
                Heard::default()
            }
            WindowEvent::KeyboardInput { event, .. } => self.key(event, controller),
            WindowEvent::ModifiersChanged(modifiers) => {
                let state = modifiers.state();
                controller.flight.hurry(state.shift_key(), state.control_key());
                Heard::default()
            }
            WindowEvent::CursorMoved { position, .. } => self.motion((position.x, position.y), height, controller),
            WindowEvent::MouseInput { state, button, .. } => self.button(*state, *button),
            WindowEvent::MouseWheel { delta, .. } => {
                controller.flight.wheel(match delta {
                    MouseScrollDelta::LineDelta(_, y) => *y,
                    MouseScrollDelta::PixelDelta(position) => (position.y / WHEEL_STEP_PX) as f32,
                });
                Heard::default()
            }
            WindowEvent::Focused(false) => {
                controller.flight.release();
                self.press = None;
                Heard::default()
            }
            _ => Heard::default(),
        }
    }

    fn key(&mut self, event: &KeyEvent, controller: &mut Controller) -> Heard {
        let PhysicalKey::Code(code) = event.physical_key else { return Heard::default() };
        self.press_key(code, event.state.is_pressed(), event.repeat, controller)
    }

    fn press_key(&mut self, code: KeyCode, is_down: bool, is_repeat: bool, controller: &mut Controller) -> Heard {
        if let Some(way) = self.way(code).filter(|_| !is_repeat) {
            controller.flight.hold(way, is_down);
            self.is_flying |= is_down;
            return Heard { moves: true, action: None };
        }
        let action = match code {
            _ if !is_down || is_repeat => None,
            KeyCode::F12 | KeyCode::KeyS => Some(Action::Save),
            KeyCode::KeyP => Some(Action::PrintCamera),
            KeyCode::KeyF => Some(Action::FrameScene),
            KeyCode::Home => Some(Action::GoHome),
            KeyCode::Tab => Some(Action::ToggleOverlay),
            KeyCode::Escape => Some(Action::Quit),
            KeyCode::Digit1 => Some(Action::Show(View::Picture)),
            KeyCode::Digit2 => Some(Action::Show(View::Depth)),
            KeyCode::Digit3 => Some(Action::Show(View::Normal)),
            KeyCode::Digit4 => Some(Action::Show(View::Id)),
            KeyCode::Digit5 => Some(Action::Show(View::Cost)),
            KeyCode::Digit6 => Some(Action::Show(View::Rays)),
            _ => None,
        };
        if matches!(action, Some(Action::FrameScene | Action::GoHome)) {
            self.is_flying = false;
            controller.flight.release();
        }
        Heard { action, moves: false }
    }

    fn way(&self, code: KeyCode) -> Option<Fly> {
        match code {
            KeyCode::KeyW => Some(Fly::Forward),
            KeyCode::KeyS if self.is_flying => Some(Fly::Back),
            KeyCode::KeyA => Some(Fly::Left),
            KeyCode::KeyD => Some(Fly::Right),
            KeyCode::KeyE => Some(Fly::Up),
            KeyCode::KeyQ => Some(Fly::Down),
            _ => None,
        }
    }

    fn motion(&mut self, to: (f64, f64), height: u32, controller: &mut Controller) -> Heard {
        let from = std::mem::replace(&mut self.cursor, to);
        let Some((button, start, was_dragged)) = &mut self.press else { return Heard::default() };
        *was_dragged |= (to.0 - start.0).hypot(to.1 - start.1) > CLICK_PX;
        if !*was_dragged {
            return Heard::default();
        }
        let height = f64::from(height.max(1));
        let (x, y) = (((to.0 - from.0) / height) as f32, ((to.1 - from.1) / height) as f32);
        match button {
            MouseButton::Left => {
                self.is_flying = false;
                controller.flight.release();
                controller.orbit(x, y);
            }
            MouseButton::Right => {
                self.is_flying = true;
                controller.look(x, y);
            }
            _ => return Heard::default(),
        }
        Heard { moves: true, action: None }
    }

    fn button(&mut self, state: ElementState, button: MouseButton) -> Heard {
        let action = match (state, self.press) {
            (ElementState::Pressed, None) => {
                self.press = Some((button, self.cursor, false));
                None
            }
            (ElementState::Released, Some((held, (x, y), was_dragged))) if held == button => {
                self.press = None;
                (button == MouseButton::Left && !was_dragged).then_some(Action::Pick { x, y })
            }
            _ => None,
        };
        Heard { action, moves: false }
    }
}

#[cfg(test)]
mod tests {
    use glam::{Vec3, vec3};

    use super::*;
    use crate::scene::Camera;

    fn controller() -> Controller {
        let camera = Camera { eye: vec3(0.0, 1.0, 5.0), target: Vec3::ZERO, up: Vec3::Y, vertical_fov_degrees: 40.0 };
        Controller::new(camera, (Vec3::NEG_ONE, Vec3::ONE))
    }

    fn tap(input: &mut Input, controller: &mut Controller, code: KeyCode) -> Option<Action> {
        let action = input.press_key(code, true, false, controller).action;
        assert_eq!(input.press_key(code, true, true, controller).action, None, "repeats do nothing");
        input.press_key(code, false, false, controller);
        action
    }

    #[test]
    fn s_saves_until_the_user_flies_and_f12_always() {
        let (mut input, mut controller) = (Input::default(), controller());
        assert_eq!(tap(&mut input, &mut controller, KeyCode::KeyS), Some(Action::Save));
        assert_eq!(tap(&mut input, &mut controller, KeyCode::KeyW), None);
        assert_eq!(tap(&mut input, &mut controller, KeyCode::KeyS), None);
        input.press_key(KeyCode::KeyS, true, false, &mut controller);
        assert!(controller.flight.is_under_way());
        assert_eq!(tap(&mut input, &mut controller, KeyCode::F12), Some(Action::Save));
        assert_eq!(tap(&mut input, &mut controller, KeyCode::Home), Some(Action::GoHome));
        assert!(!controller.flight.is_under_way());
        assert_eq!(tap(&mut input, &mut controller, KeyCode::KeyS), Some(Action::Save));
    }

    #[test]
    fn a_click_picks_and_a_drag_turns() {
        let (mut input, mut controller) = (Input::default(), controller());
        let start = *controller.camera();
        input.motion((10.0, 20.0), 100, &mut controller);
        input.button(ElementState::Pressed, MouseButton::Left);
        input.motion((11.0, 21.0), 100, &mut controller);
        let click = input.button(ElementState::Released, MouseButton::Left);
        assert_eq!(click.action, Some(Action::Pick { x: 10.0, y: 20.0 }));
        assert_eq!(*controller.camera(), start);
        for button in [MouseButton::Left, MouseButton::Right] {
            let before = *controller.camera();
            input.button(ElementState::Pressed, button);
            assert!(input.motion((50.0, 20.0), 100, &mut controller).moves);
            assert_eq!(input.button(ElementState::Released, button).action, None);
            let after = *controller.camera();
            assert_eq!(before.eye == after.eye, button == MouseButton::Right);
            assert_eq!(before.target == after.target, button == MouseButton::Left);
            assert!(!input.motion((10.0, 20.0), 100, &mut controller).moves);
        }
    }
}
