//! Handles signals.
//!
//! On SIGHUP, SIGINT and SIGTERM, the process removes the temporary files of outputs before it ends. While there is a
//! picture to write, the first SIGINT lets it be written before ([`interrupt`]). A write beyond the limit on the size
//! of files (`ulimit -f`) returns an error; by default, SIGXFSZ would end the process.

use std::{
    fs,
    sync::{Arc, atomic::AtomicBool, mpsc},
    thread,
};

use kdray::output;
use signal_hook::{
    consts::{SIGHUP, SIGINT, SIGTERM, SIGXFSZ},
    flag,
    iterator::Signals,
    low_level::emulate_default_handler,
};

use super::interrupt;

/// Installs the signal handlers. A signal whose handler the system refuses keeps its default.
pub fn handle() {
    let ending: Vec<_> = [SIGHUP, SIGINT, SIGTERM].into_iter().filter(|signal| !is_ignored(*signal)).collect();
    let (ready, is_ready) = mpsc::channel();
    let wait = move || {
        let signals = Signals::new(ending);
        // `handle` waits for this message, so that the handlers are installed when it returns.
        let _ = ready.send(());
        signals.map(end_by)
    };
    if thread::Builder::new().name("signals".to_owned()).spawn(wait).is_ok() {
        // An error means that the thread has ended, and the handlers with it.
        let _ = is_ready.recv();
    }
    // With any handler installed, `write` returns the error. A flag that nobody reads is the simplest handler.
    let _ = flag::register(SIGXFSZ, Arc::new(AtomicBool::new(false)));
}

/// Waits for a signal that ends the process at once, and ends it.
fn end_by(mut signals: Signals) {
    for signal in signals.forever() {
        if signal == SIGINT && interrupt::ask() {
            tracing::info!("interrupted: kdray ends when the present picture is written; Ctrl-C again ends it at once");
            continue;
        }
        end(signal);
    }
}

/// Ends the process as Ctrl-C does by default.
pub fn end_by_interrupt() {
    end(SIGINT);
}

/// Removes temporary files and ends the process as the signal does by default. A shell reports exit code 128 + signal.
fn end(signal: i32) {
    output::remove_temporaries();
    let _ = emulate_default_handler(signal);
}

/// Returns whether the process was started with the signal ignored, as `nohup` does with SIGHUP. Such a signal stays
/// ignored.
fn is_ignored(signal: i32) -> bool {
    fs::read_to_string("/proc/self/status").is_ok_and(|status| ignored_signals(&status) >> (signal - 1) & 1 == 1)
}

/// Returns the bit mask after `SigIgn:` in a process's status on Linux. Bit n - 1 stands for signal n.
fn ignored_signals(status: &str) -> u64 {
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ignored_signals_are_bits_of_the_status() {
        let status = "Name:\tkdray\nSigBlk:\tffffffffffffffff\nSigIgn:\t0000000000001001\nSigCgt:\t0000000000000002\n";
        assert_eq!(ignored_signals(status), 1 << (SIGHUP - 1) | 1 << (13 - 1));
        assert_eq!(ignored_signals("Name:\tkdray\n"), 0);
    }
}
