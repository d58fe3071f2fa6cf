//! Asks a Vulkan driver for its devices in a process of its own, so that a driver that crashes or hangs is found, and
//! not the end of the command.

use std::{
    env,
    ffi::OsStr,
    io::{self, Read},
    process::{Child, Command, ExitStatus, Stdio},
    sync::mpsc::{self, Receiver},
    thread,
    time::{Duration, Instant},
};

use kdray::gpu;
use serde::{Deserialize, Serialize};

use crate::cli::{error::CliError, print_raw};

/// The hidden subcommand by which the process is started.
pub const SUBCOMMAND: &str = "probe-drivers";
/// Longest time of a probe. Drivers answer within a second, and on a busy machine within several.
const LIMIT: Duration = Duration::from_secs(20);
/// How long a process that has been ended, and what it has printed, are waited for.
const LAST_WORDS: Duration = Duration::from_secs(1);
/// Greatest number of bytes of the loader's messages that are read.
const MOST_BYTES: u64 = 1 << 20;
/// What the loader says after the reason why a library cannot be loaded.
const NOT_LOADED: &str = "Failed loading library associated with ICD JSON";

/// What a driver has answered.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Answer {
    /// Its devices, at least one.
    Devices(Vec<Probed>),
    /// It has no device here.
    NoDevice,
    /// Its library cannot be loaded, for this reason.
    NotLoaded(String),
    /// Its process has ended in this way.
    Crashed(String),
    /// There was no answer within this number of seconds.
    Hung(u64),
}

/// A device of a driver.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Probed {
    pub name: String,
    pub is_software: bool,
}

/// Prints the devices of all drivers as JSON: what the process of a probe does.
pub fn print_devices() -> Result<(), CliError> {
    let devices = gpu::devices()?.into_iter();
    let probed: Vec<_> =
        devices.map(|device| Probed { is_software: device.is_software(), name: device.name }).collect();
    print_raw(&serde_json::to_string(&probed).expect("names and flags"))
}

/// Asks the driver of a manifest alone, or without a manifest all drivers together.
pub fn probe(manifest: Option<&OsStr>) -> io::Result<Answer> {
    let mut command = Command::new(env::current_exe()?);
    command.arg(SUBCOMMAND).env("VK_LOADER_DEBUG", "error").stdin(Stdio::null());
    if let Some(manifest) = manifest {
        // Older loaders know only the second name.
        command.env("VK_DRIVER_FILES", manifest).env("VK_ICD_FILENAMES", manifest).env_remove("VK_ADD_DRIVER_FILES");
    }
    let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn()?;
    let (stdout, stderr) = (text_of(child.stdout.take()), text_of(child.stderr.take()));
    let Some(status) = end_of(&mut child)? else { return Ok(Answer::Hung(LIMIT.as_secs())) };
    Ok(answer(status, &collected(stdout), &collected(stderr)))
}

/// Reads a pipe on a thread of its own, so that the process never waits for its reader. A driver may have started other
/// processes that keep the pipe open.
fn text_of(pipe: Option<impl Read + Send + 'static>) -> Receiver<Vec<u8>> {
    let (send, receive) = mpsc::channel();
    thread::spawn(move || {
        let Some(mut pipe) = pipe.map(|pipe| pipe.take(MOST_BYTES)) else { return };
        let mut bytes = [0; 4096];
        // What cannot be read is left out. Nobody waits any more if it took too long.
        while let Ok(n @ 1..) = pipe.read(&mut bytes) {
            if send.send(bytes[..n].to_vec()).is_err() {
                break;
            }
        }
    });
    receive
}

/// Collects the output of a process that has ended.
fn collected(chunks: Receiver<Vec<u8>>) -> String {
    let (end, mut bytes) = (Instant::now() + LAST_WORDS, Vec::new());
    while let Ok(chunk) = chunks.recv_timeout(end.saturating_duration_since(Instant::now())) {
        bytes.extend(chunk);
    }
    String::from_utf8_lossy(&bytes).into_owned()
}

/// Waits for the end of the process. One that takes too long is ended: then there is no status.
fn end_of(child: &mut Child) -> io::Result<Option<ExitStatus>> {
    if let Some(status) = wait_for(child, LIMIT)? {
        return Ok(Some(status));
    }
    child.kill()?;
    // A process that waits within a driver for a GPU that hangs does not end.
    wait_for(child, LAST_WORDS)?;
    Ok(None)
}

fn wait_for(child: &mut Child, limit: Duration) -> io::Result<Option<ExitStatus>> {
    let begin = Instant::now();
    while begin.elapsed() < limit {
        if let Some(status) = child.try_wait()? {
            return Ok(Some(status));
        }
        thread::sleep(Duration::from_millis(5));
    }
    Ok(None)
}

/// Reads the answer from what the process has printed.
fn answer(status: ExitStatus, stdout: &str, stderr: &str) -> Answer {
    if status.success() {
        // Some drivers print, too.
        let devices = stdout.lines().rev().find_map(|line| serde_json::from_str::<Vec<Probed>>(line).ok());
        return match devices {
            Some(devices) if !devices.is_empty() => Answer::Devices(devices),
            _ => Answer::NoDevice,
        };
    }
    if status.code() != Some(4) {
        return Answer::Crashed(status.to_string());
    }
    not_loaded(stderr).map_or(Answer::NoDevice, Answer::NotLoaded)
}

/// Returns the loader's reason why a library cannot be loaded: the message before the one that says so.
fn not_loaded(stderr: &str) -> Option<String> {
    let lines: Vec<&str> = stderr.lines().collect();
    let line_ix = lines.iter().position(|line| line.contains(NOT_LOADED))?;
    let reason = lines[line_ix.checked_sub(1)?];
    // The label and the number of a message differ between loaders.
    let text = reason.split_once("Code 0 : ").or_else(|| reason.split_once(':')).map_or(reason, |(_, text)| text);
    Some(text.trim().to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_loader_s_reason_is_found() {
        let of = |stderr: &str| not_loaded(stderr).unwrap_or_default();
        let old = "ERROR:            libnone.so.9: cannot open shared object file: No such file or directory\n\
                   ERROR:            loader_icd_scan: Failed loading library associated with ICD JSON libnone.so.9. \
                   Ignoring this JSON\nERROR:            vkCreateInstance: Found no drivers!\nerror: none\n";
        let reason = "libnone.so.9: cannot open shared object file: No such file or directory";
        assert_eq!(of(old), reason);
        assert_eq!(of(&old.replace("ERROR:            lib", "ERROR: [Loader Message] Code 0 : lib")), reason);
        assert_eq!(of("ERROR:            vkCreateInstance: Found no drivers!\n"), "");
    }

    #[cfg(unix)]
    #[test]
    fn answers_are_told_apart() {
        use std::os::unix::process::ExitStatusExt;
        let code = |code: i32| ExitStatus::from_raw(code << 8);
        let devices = r#"[{"name":"d","is_software":true}]"#;
        let probed = Probed { name: "d".to_owned(), is_software: true };
        assert_eq!(answer(code(0), devices, ""), Answer::Devices(vec![probed]));
        assert_eq!(answer(code(4), "", "error: no Vulkan driver found\n"), Answer::NoDevice);
        assert!(matches!(answer(ExitStatus::from_raw(11), "", ""), Answer::Crashed(how) if how.contains("11")));
    }
}
