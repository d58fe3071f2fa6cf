//! A display for a test: an X server without a screen, what it shows, and simulated keys and mouse.

use std::{
    fs,
    io::{BufRead, BufReader},
    path::{Path, PathBuf},
    process::{Child, Command, Stdio},
    thread,
    time::{Duration, Instant},
};

use tempfile::TempDir;
use x11rb::{
    connection::Connection,
    protocol::{
        Event,
        xproto::{
            ClientMessageEvent, ConnectionExt, CreateWindowAux, EventMask, PropMode, SELECTION_NOTIFY_EVENT,
            SelectionNotifyEvent, WindowClass,
        },
    },
    wrapper::ConnectionExt as _,
};

/// Longer than any picture takes to appear on a busy machine.
pub const PATIENCE: Duration = Duration::from_secs(120);

/// A running Xvfb.
pub struct Display {
    server: Child,
    /// The value of the environment variable DISPLAY.
    pub name: String,
    /// Holds the screen's memory, as an XWD file.
    memory: TempDir,
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
        let memory = TempDir::new().unwrap();
        let mut server = Command::new("Xvfb")
            .args(["-displayfd", "1", "-nolisten", "tcp", "-screen", "0", &format!("{width}x{height}x24"), "-fbdir"])
            .arg(memory.path())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .expect("Xvfb, which ./setup installs");
        let mut number = String::new();
        BufReader::new(server.stdout.take().unwrap()).read_line(&mut number).unwrap();
        assert!(!number.trim().is_empty(), "Xvfb found no free display");
        Self { server, name: format!(":{}", number.trim()), memory }
    }

    /// Returns what the screen shows at present.
    pub fn screen(&self) -> Screen {
        let xwd = fs::read(self.memory.path().join("Xvfb_screen0")).unwrap();
        let field = |ix: usize| u32::from_be_bytes(xwd[4 * ix..4 * ix + 4].try_into().unwrap()) as usize;
        let [header, width, height, bits, stride, n_colors] = [0, 4, 5, 11, 12, 19].map(field);
        assert_eq!((field(2), bits, field(7)), (2, 32, 0), "32 bits a pixel, the lowest byte first");
        let pixels = &xwd[header + 12 * n_colors..];
        let row = |y: usize| (0..width).map(move |x| &pixels[y * stride + 4 * x..][..4]);
        let pixels = (0..height).flat_map(|y| row(y).map(|bgrx| [bgrx[2], bgrx[1], bgrx[0]])).collect();
        Screen { width, height, pixels }
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
        let (connection, _) = x11rb::connect(Some(&self.name)).expect("a connection to Xvfb");
        let atom = |name: &str| connection.intern_atom(false, name.as_bytes()).unwrap().reply().unwrap().atom;
        let window = window.parse().expect("a window's id");
        let data = [atom("WM_DELETE_WINDOW"), x11rb::CURRENT_TIME, 0, 0, 0];
        let message = ClientMessageEvent::new(32, window, atom("WM_PROTOCOLS"), data);
        connection.send_event(false, window, EventMask::NO_EVENT, message).unwrap();
        // The server may drop what it has not read yet when a connection ends, so the test waits for a reply.
        connection.get_input_focus().unwrap().reply().expect("a reply after the message");
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

    /// Waits for the window of a name and gives it the keyboard focus, since there is no window manager that would.
    /// Returns the window's id.
    pub fn focus(&self, name: &str) -> String {
        let window = self.act(&["search", "--sync", "--name", name]).lines().last().unwrap().to_owned();
        self.act(&["windowfocus", "--sync", &window]);
        window
    }
}

impl Drop for Display {
    fn drop(&mut self) {
        let _ = self.server.kill();
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
