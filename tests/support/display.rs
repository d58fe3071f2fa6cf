//! A display for a test: an X server without a screen, what it shows, and simulated keys and mouse.

use std::{
    io::{BufRead, BufReader},
    path::{Path, PathBuf},
    process::{Child, Command, Stdio},
    thread,
    time::{Duration, Instant},
};

use rustix::process::{Pid, Signal, kill_process};
use x11rb::{
    connection::Connection,
    protocol::{
        Event,
        xproto::{
            ChangeWindowAttributesAux, ClientMessageEvent, ConnectionExt, CreateWindowAux, EventMask, ImageFormat,
            ImageOrder, PropMode, SELECTION_NOTIFY_EVENT, SelectionNotifyEvent, WindowClass,
        },
    },
    rust_connection::RustConnection,
    wrapper::ConnectionExt as _,
};

use super::command::PATIENCE;

/// A running Xvfb.
pub struct Display {
    server: Child,
    /// The value of the environment variable DISPLAY.
    pub name: String,
    /// Reads the screen. While it is open, the server does not reset itself, as it does when its last client leaves.
    connection: RustConnection,
    /// Index of the server's only screen.
    screen_ix: usize,
}

/// The contents of a screen or of a picture file: rows from the top, RGB.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Screen {
    pub width: usize,
    pub height: usize,
    pub pixels: Vec<[u8; 3]>,
}

impl Display {
    pub fn start(width: u32, height: u32) -> Self {
        let mut server = Command::new("Xvfb")
            .args(["-displayfd", "1", "-nolisten", "tcp", "-screen", "0", &format!("{width}x{height}x24")])
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .expect("Xvfb, which ./setup installs");
        let mut number = String::new();
        BufReader::new(server.stdout.take().unwrap()).read_line(&mut number).unwrap();
        assert!(!number.trim().is_empty(), "Xvfb found no free display");
        let name = format!(":{}", number.trim());
        let (connection, screen_ix) = x11rb::connect(Some(&name)).expect("a connection to Xvfb");
        Self { server, name, connection, screen_ix }
    }

    /// Returns what the screen shows at present, without the mouse pointer. The server draws the pointer into the
    /// memory of its screen, also if it lies over a window from outside, so the pixels are not read from there.
    pub fn screen(&self) -> Screen {
        let setup = self.connection.setup();
        let root = &setup.roots[self.screen_ix];
        let (width, height) = (root.width_in_pixels, root.height_in_pixels);
        let image = self.connection.get_image(ImageFormat::Z_PIXMAP, root.root, 0, 0, width, height, !0).unwrap();
        let image = image.reply().expect("the screen's image");
        let (width, height) = (usize::from(width), usize::from(height));
        assert_eq!((setup.image_byte_order, image.data.len()), (ImageOrder::LSB_FIRST, 4 * width * height));
        Screen { width, height, pixels: image.data.chunks_exact(4).map(|bgrx| [bgrx[2], bgrx[1], bgrx[0]]).collect() }
    }

    /// Waits until `is_so` is true of the screen.
    pub fn wait_until(&self, what: &str, is_so: impl Fn(&Screen) -> bool) {
        let start = Instant::now();
        while !is_so(&self.screen()) {
            assert!(start.elapsed() < PATIENCE, "the screen never showed {what}");
            thread::sleep(Duration::from_millis(20));
        }
    }

    /// Runs xdotool; `arguments` are its commands.
    pub fn act(&self, arguments: &[&str]) -> String {
        let output = Command::new("xdotool").args(arguments).env("DISPLAY", &self.name).output();
        let output = output.expect("xdotool, which ./setup installs");
        assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stdout).unwrap()
    }

    /// Closes a window as a window manager does when its user clicks the close button.
    pub fn close(&self, window: &str) {
        let connection = &self.connection;
        let atom = |name: &str| connection.intern_atom(false, name.as_bytes()).unwrap().reply().unwrap().atom;
        let window = window.parse().expect("a window's id");
        let data = [atom("WM_DELETE_WINDOW"), x11rb::CURRENT_TIME, 0, 0, 0];
        let message = ClientMessageEvent::new(32, window, atom("WM_PROTOCOLS"), data);
        connection.send_event(false, window, EventMask::NO_EVENT, message).unwrap();
        connection.flush().unwrap();
    }

    /// Drops a file on a window as a file manager does, by the protocol XDND, and waits until the window has taken it.
    pub fn drop_file(&self, window: &str, file: &Path) {
        let (connection, screen_ix) = x11rb::connect(Some(&self.name)).expect("a connection to Xvfb");
        let atom = |name: &str| connection.intern_atom(false, name.as_bytes()).unwrap().reply().unwrap().atom;
        let target: u32 = window.parse().expect("a window's id");
        let source = connection.generate_id().unwrap();
        let (root, look) = (connection.setup().roots[screen_ix].root, &CreateWindowAux::new());
        connection.create_window(0, source, root, 0, 0, 1, 1, 0, WindowClass::INPUT_ONLY, 0, look).unwrap();
        connection.set_selection_owner(source, atom("XdndSelection"), x11rb::CURRENT_TIME).unwrap();
        let send = |name: &str, data: [u32; 4]| {
            let data = [source, data[0], data[1], data[2], data[3]];
            let message = ClientMessageEvent::new(32, target, atom(name), data);
            connection.send_event(false, target, EventMask::NO_EVENT, message).unwrap();
            connection.flush().unwrap();
        };
        send("XdndEnter", [5 << 24, atom("text/uri-list"), 0, 0]);
        send("XdndPosition", [0, 1 << 16 | 1, x11rb::CURRENT_TIME, atom("XdndActionCopy")]);
        let start = Instant::now();
        loop {
            match connection.poll_for_event().unwrap() {
                Some(Event::SelectionRequest(request)) => {
                    let list = format!("file://{}\r\n", file.display());
                    let (mode, of) = (PropMode::REPLACE, request.requestor);
                    connection.change_property8(mode, of, request.property, request.target, list.as_bytes()).unwrap();
                    let notice = SelectionNotifyEvent {
                        response_type: SELECTION_NOTIFY_EVENT,
                        sequence: 0,
                        time: request.time,
                        requestor: of,
                        selection: request.selection,
                        target: request.target,
                        property: request.property,
                    };
                    connection.send_event(false, of, EventMask::NO_EVENT, notice).unwrap();
                    send("XdndDrop", [0, x11rb::CURRENT_TIME, 0, 0]);
                }
                Some(Event::ClientMessage(message)) if message.type_ == atom("XdndFinished") => return,
                Some(_) => {}
                None => {
                    assert!(start.elapsed() < PATIENCE, "the window took no file");
                    thread::sleep(Duration::from_millis(5));
                }
            }
        }
    }

    /// Gives the screen a mouse pointer that is drawn, and moves it to a point in pixels.
    pub fn show_pointer(&self, x: i16, y: i16) {
        let (connection, root) = (&self.connection, self.connection.setup().roots[self.screen_ix].root);
        let [font, cursor] = [(), ()].map(|()| connection.generate_id().unwrap());
        connection.open_font(font, b"cursor").unwrap();
        // A black arrow with a white edge: the glyph 68 and its mask.
        connection.create_glyph_cursor(cursor, font, font, 68, 69, 0, 0, 0, !0, !0, !0).unwrap();
        let look = ChangeWindowAttributesAux::new().cursor(cursor);
        connection.change_window_attributes(root, &look).unwrap().check().expect("a pointer");
        connection.warp_pointer(x11rb::NONE, root, 0, 0, 0, 0, x, y).unwrap().check().expect("a motion");
    }

    /// Waits until a window of a name is visible and gives it the keyboard focus, since there is no window manager that
    /// would. Returns the window's id.
    pub fn focus(&self, name: &str) -> String {
        // The server refuses to give the focus to a window that has its name but is not shown yet.
        let found = self.act(&["search", "--sync", "--onlyvisible", "--name", name]);
        let window = found.lines().last().unwrap().to_owned();
        self.act(&["windowfocus", "--sync", &window]);
        window
    }
}

impl Drop for Display {
    fn drop(&mut self) {
        // The server removes its lock and its socket from /tmp when it is asked to end, but not when it is killed.
        let _ = kill_process(Pid::from_child(&self.server), Signal::TERM);
        let _ = self.server.wait();
    }
}

impl Screen {
    /// Loads a picture file.
    pub fn load(path: &PathBuf) -> Self {
        let image = image::open(path).unwrap().to_rgb8();
        let pixels = image.pixels().map(|pixel| pixel.0).collect();
        Self { width: image.width() as usize, height: image.height() as usize, pixels }
    }

    /// Tells whether this is the upper left part of `screen`.
    pub fn is_shown_on(&self, screen: &Screen) -> bool {
        let row = |of: &Screen, y: usize| of.pixels[y * of.width..][..self.width].to_vec();
        self.width <= screen.width
            && self.height <= screen.height
            && (0..self.height).all(|y| row(self, y) == row(screen, y))
    }
}
