//! Turns the window's keyboard and mouse events into camera moves and actions.

use winit::{
    event::{ElementState, KeyEvent, MouseButton, MouseScrollDelta, WindowEvent},
    keyboard::{Key, KeyCode, ModifiersState, PhysicalKey},
};

use super::{
    controller::Controller,
    flight::Fly,
    mouse::{Drag, Mouse},
};
use crate::frame::View;

/// Pixels that count as one step of a wheel or touchpad that reports pixels.
const WHEEL_STEP_PX: f64 = 50.0;

/// Action that is done once for each key press or click.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Action {
    /// Saves the picture once it is displayed at the window's size.
    Save,
    /// Prints the camera in the format of scene files.
    PrintCamera,
    /// Moves the camera so that the scene fills the window.
    FrameScene,
    /// Moves the camera back to where it started.
    GoHome,
    /// Makes another axis point up in the picture.
    ChangeUp,
    /// Draws the other picture while the camera moves.
    ChangeMotion,
    /// Plays the animations, or pauses them.
    Play,
    TogglePanel,
    /// Shows or hides the list of keys.
    ToggleKeys,
    /// Shows another view of the picture.
    Show(View),
    /// Follows the rays of the pixel at a point of the window, in pixels from the window's upper left corner.
    Pick {
        x: f64,
        y: f64,
    },
    /// Closes the list of keys, or else the window.
    Quit,
}

/// Result of an event.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct InputEffect {
    /// The action that the event triggers.
    pub action: Option<Action>,
    /// Whether the event has moved the camera, or a key that moves it went down or up.
    pub moves: bool,
}

/// State of keys and mouse that decides what the next event means.
#[derive(Debug, Default)]
pub struct Input {
    mouse: Mouse,
    modifiers: ModifiersState,
    /// Whether the key S flies back rather than saves. It flies back from the first flight key or look drag until the
    /// camera is framed, sent home, orbited or panned.
    is_flying: bool,
}

impl Input {
    /// Returns whether the key S flies back rather than saves the picture.
    pub fn is_flying(&self) -> bool {
        self.is_flying
    }

    /// Returns the pointer's position in pixels from the window's upper left corner.
    pub fn pointer(&self) -> (f64, f64) {
        self.mouse.position()
    }

    /// Handles an event that the overlay has not taken. `window` is the window's size in pixels.
    pub fn handle(&mut self, event: &WindowEvent, window: (u32, u32), controller: &mut Controller) -> InputEffect {
        match event {
            // A synthetic press reports a key that was already down when the window gained the focus. It is ignored:
            // a key that is pressed from then on has an event of its own.
            WindowEvent::KeyboardInput { event, is_synthetic: true, .. } if event.state.is_pressed() => {
                InputEffect::default()
            }
            WindowEvent::KeyboardInput { event, .. } => self.key(event, controller),
            WindowEvent::ModifiersChanged(modifiers) => {
                self.modifiers = modifiers.state();
                controller.flight.hurry(self.modifiers.shift_key(), self.modifiers.control_key());
                InputEffect::default()
            }
            WindowEvent::CursorMoved { position, .. } => self.motion((position.x, position.y), window, controller),
            WindowEvent::MouseInput { state, button, .. } => self.button(*state, *button),
            WindowEvent::MouseWheel { delta, .. } => {
                let steps = match delta {
                    MouseScrollDelta::LineDelta(_, y) => *y,
                    MouseScrollDelta::PixelDelta(position) => (position.y / WHEEL_STEP_PX) as f32,
                };
                self.wheel(steps, window, controller)
            }
            WindowEvent::Focused(false) => {
                controller.flight.release();
                self.mouse.release();
                InputEffect::default()
            }
            _ => InputEffect::default(),
        }
    }

    fn key(&mut self, event: &KeyEvent, controller: &mut Controller) -> InputEffect {
        if let (ElementState::Pressed, Key::Character(symbol)) = (event.state, &event.logical_key)
            && let Some(effect) = press_symbol(symbol, event.repeat, controller)
        {
            return effect;
        }
        let PhysicalKey::Code(code) = event.physical_key else { return InputEffect::default() };
        self.press_key(code, event.state.is_pressed(), event.repeat, controller)
    }

    fn press_key(&mut self, code: KeyCode, is_down: bool, is_repeat: bool, controller: &mut Controller) -> InputEffect {
        if let Some(way) = self.way(code).filter(|_| !is_repeat) {
            controller.flight.hold(way, is_down);
            self.is_flying |= is_down;
            return InputEffect { moves: true, action: None };
        }
        let action = match code {
            _ if !is_down || is_repeat => None,
            KeyCode::F12 | KeyCode::KeyS => Some(Action::Save),
            KeyCode::KeyP => Some(Action::PrintCamera),
            KeyCode::KeyF => Some(Action::FrameScene),
            KeyCode::Home => Some(Action::GoHome),
            KeyCode::KeyU => Some(Action::ChangeUp),
            KeyCode::KeyM => Some(Action::ChangeMotion),
            KeyCode::KeyH | KeyCode::F1 => Some(Action::ToggleKeys),
            KeyCode::Space => Some(Action::Play),
            KeyCode::Tab => Some(Action::TogglePanel),
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
        InputEffect { action, moves: false }
    }

    /// Returns the direction of flight of a key, or none for other keys.
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

    /// Zooms by steps of the wheel or, with Ctrl or Alt, changes the speed of flight.
    fn wheel(&mut self, steps: f32, window: (u32, u32), controller: &mut Controller) -> InputEffect {
        if self.modifiers.control_key() || self.modifiers.alt_key() {
            controller.flight.change_speed(steps);
            return InputEffect::default();
        }
        let (x, y) = self.mouse.offset_from_middle(window);
        controller.zoom(steps, x, y);
        InputEffect { moves: steps != 0.0, action: None }
    }

    fn motion(&mut self, to: (f64, f64), window: (u32, u32), controller: &mut Controller) -> InputEffect {
        let Some((drag, (x, y))) = self.mouse.moves(to, window) else { return InputEffect::default() };
        self.is_flying = drag == Drag::Look;
        if !self.is_flying {
            controller.flight.release();
        }
        match drag {
            Drag::Orbit => controller.orbit(x, y),
            Drag::Look => controller.look(x, y),
            Drag::Pan => controller.pan(x, y),
        }
        InputEffect { moves: true, action: None }
    }

    fn button(&mut self, state: ElementState, button: MouseButton) -> InputEffect {
        let click = self.mouse.button(state, button, self.modifiers.shift_key());
        InputEffect { action: click.map(|(x, y)| Action::Pick { x, y }), moves: false }
    }
}

/// Handles keys that are known by the character that they write, whatever their place on the keyboard. Returns none
/// for other keys.
fn press_symbol(symbol: &str, is_repeat: bool, controller: &mut Controller) -> Option<InputEffect> {
    match symbol {
        "+" | "=" => controller.flight.change_speed(1.0),
        "-" => controller.flight.change_speed(-1.0),
        "," | "." => {
            controller.widen(if symbol == "." { 1.0 } else { -1.0 });
            return Some(InputEffect { action: None, moves: true });
        }
        "?" if is_repeat => {}
        "?" => return Some(InputEffect { action: Some(Action::ToggleKeys), moves: false }),
        _ => return None,
    }
    Some(InputEffect::default())
}

#[cfg(test)]
mod tests {
    use glam::{Vec3, vec3};

    use super::*;
    use crate::scene::{Camera, Projection};

    const WINDOW: (u32, u32) = (200, 100);

    fn controller() -> Controller {
        let camera = Camera {
            eye: vec3(0.0, 1.0, 5.0),
            target: Vec3::ZERO,
            up: Vec3::Y,
            projection: Projection::Perspective { vertical_fov_degrees: 40.0 },
        };
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
        input.motion((10.0, 20.0), WINDOW, &mut controller);
        input.button(ElementState::Pressed, MouseButton::Left);
        input.motion((11.0, 21.0), WINDOW, &mut controller);
        let click = input.button(ElementState::Released, MouseButton::Left);
        assert_eq!(click.action, Some(Action::Pick { x: 10.0, y: 20.0 }));
        assert_eq!(*controller.camera(), start);
        for button in [MouseButton::Left, MouseButton::Right] {
            let before = *controller.camera();
            input.button(ElementState::Pressed, button);
            assert!(input.motion((50.0, 20.0), WINDOW, &mut controller).moves);
            assert_eq!(input.button(ElementState::Released, button).action, None);
            let after = *controller.camera();
            assert_eq!(before.eye == after.eye, button == MouseButton::Right);
            assert_eq!(before.target == after.target, button == MouseButton::Left);
            assert!(!input.motion((10.0, 20.0), WINDOW, &mut controller).moves);
        }
    }

    /// Returns eye and target after a drag to the right.
    fn dragged(button: MouseButton, modifiers: ModifiersState) -> (Vec3, Vec3) {
        let (mut input, mut controller) = (Input { modifiers, ..Input::default() }, controller());
        input.motion((10.0, 20.0), WINDOW, &mut controller);
        input.button(ElementState::Pressed, button);
        input.motion((50.0, 20.0), WINDOW, &mut controller);
        let Camera { eye, target, .. } = *controller.camera();
        (eye, target)
    }

    #[test]
    fn middle_drags_and_shifted_left_ones_pan() {
        let Camera { eye, target, .. } = *controller().camera();
        let panned = dragged(MouseButton::Middle, ModifiersState::empty());
        assert_eq!(panned, dragged(MouseButton::Left, ModifiersState::SHIFT));
        assert!(panned.0 != eye && (panned.0 - eye - (panned.1 - target)).length() < 1e-5);
        assert_eq!(dragged(MouseButton::Left, ModifiersState::empty()).1, target, "without Shift it goes around");
    }

    #[test]
    fn the_wheel_goes_nearer_and_with_ctrl_or_alt_changes_the_speed() {
        let (mut input, mut controller) = (Input::default(), controller());
        let (before, speed) = (*controller.camera(), controller.flight.speed());
        input.motion((100.0, 50.0), WINDOW, &mut controller);
        assert!(input.wheel(2.0, WINDOW, &mut controller).moves);
        let after = *controller.camera();
        let distance = |camera: &Camera| (camera.target - camera.eye).length();
        assert!(distance(&after) < 0.9 * distance(&before) && (after.target - before.target).length() < 1e-5);
        input.motion((200.0, 50.0), WINDOW, &mut controller);
        input.wheel(1.0, WINDOW, &mut controller);
        let right = (before.target - before.eye).cross(before.up);
        assert!((controller.camera().target - after.target).dot(right) > 0.0, "to where the mouse points");
        assert_eq!(controller.flight.speed(), speed);
        for modifiers in [ModifiersState::CONTROL, ModifiersState::ALT] {
            let (camera, speed) = (*controller.camera(), controller.flight.speed());
            input.modifiers = modifiers;
            assert!(!input.wheel(1.0, WINDOW, &mut controller).moves);
            assert!(*controller.camera() == camera && controller.flight.speed() > speed);
        }
    }

    #[test]
    fn symbols_change_speed_and_field_of_view_and_show_the_keys() {
        let mut controller = controller();
        let speed = controller.flight.speed();
        press_symbol("+", false, &mut controller);
        assert!(controller.flight.speed() > speed);
        press_symbol("-", true, &mut controller);
        assert!((controller.flight.speed() - speed).abs() < 1e-6);
        let height = controller.camera().height_at(1.0);
        let moves = Some(InputEffect { action: None, moves: true });
        assert_eq!(press_symbol(".", true, &mut controller), moves);
        assert!(controller.camera().height_at(1.0) > height);
        assert_eq!(press_symbol(",", false, &mut controller), moves);
        assert!((controller.camera().height_at(1.0) - height).abs() < 1e-5);
        assert_eq!(tap(&mut Input::default(), &mut controller, KeyCode::KeyU), Some(Action::ChangeUp));
        let shows = Some(InputEffect { action: Some(Action::ToggleKeys), moves: false });
        assert_eq!(press_symbol("?", false, &mut controller), shows);
        assert_eq!(press_symbol("?", true, &mut controller), Some(InputEffect::default()));
        assert_eq!(press_symbol("a", false, &mut controller), None);
        for code in [KeyCode::KeyH, KeyCode::F1] {
            assert_eq!(tap(&mut Input::default(), &mut controller, code), Some(Action::ToggleKeys));
        }
    }
}
