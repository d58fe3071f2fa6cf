//! Tests of a session whose animations play, on the CPU and without a window.

use std::time::Instant;

use super::{
    InMotion, LoadSettings, LoadedScene, Settings, gpu_session::GpuSession, input::Action, saver::Saver,
    session::Session, timeline::Playback,
};
use crate::{
    engine::{
        Builder, LoadRequest,
        choices::{Processor, Request},
    },
    frame::{RenderOptions, View},
};

#[path = "../../tests/support/animated.rs"]
mod animated;

const WINDOW: (u32, u32) = (64, 48);

fn session() -> (Session, GpuSession) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("moving.gltf");
    std::fs::write(&path, animated::moving(true).to_string()).unwrap();
    let builder = Builder::new(Processor::Cpu, Request::default());
    let mut request = LoadRequest::default();
    request.scene.at = Some(0.0);
    let loaded = LoadedScene::load(&path, &LoadSettings { request, builder }).unwrap();
    let options = RenderOptions { width: WINDOW.0, height: WINDOW.1, ..loaded.built.options.clone() };
    let gpu = GpuSession::open(None, &loaded, &options, Request::default()).unwrap();
    let settings = Settings {
        options,
        in_motion: InMotion::default(),
        max_samples: 1,
        budget_ms: 1e6,
        vsync: true,
        view: View::Picture,
        gain: 1.0,
    };
    let mut session = Session::new(loaded, settings, true, (|_| (), Saver::new(|| ())));
    // The file is read when another moment is due, so that it is there as long.
    set(&mut session, |playback| playback.seconds = 0.125);
    let mut session = (session, gpu);
    draw(&mut session);
    session
}

fn set(session: &mut Session, change: impl FnOnce(&mut Playback)) {
    let timeline = session.loaded.timeline.as_mut().unwrap();
    let mut playback = *timeline.playback();
    change(&mut playback);
    timeline.set(playback);
}

/// Draws until a picture of the window's size shows the newest moment.
fn draw((session, gpu): &mut (Session, GpuSession)) {
    loop {
        session.draw(gpu, WINDOW).unwrap();
        let is_whole = gpu.front().displayed().is_some_and(|displayed| displayed.size == WINDOW);
        if is_whole && gpu.renderer.n_samples() > 0 && !session.loaded.timeline.as_ref().unwrap().is_busy() {
            return;
        }
    }
}

/// Returns the place of a pixel within the upper square of the displayed picture.
fn upper_square(gpu: &GpuSession) -> (f64, f64) {
    let picture = gpu.front().displayed_picture().unwrap().unwrap();
    let first = picture.display.iter().position(|pixel| pixel[0] > 40).expect("a square") as u32;
    (f64::from(first % picture.width + 3), f64::from(first / picture.width + 3))
}

fn click((session, gpu): &mut (Session, GpuSession), (x, y): (f64, f64)) -> Option<u32> {
    session.act(Action::Pick { x, y }, gpu, WINDOW);
    Some(session.picked.as_ref()?.rays[0].hit.as_ref()?.origin.instance_ix)
}

#[test]
fn a_click_picks_in_the_moment_that_is_seen() {
    let mut shown = session();
    let before = upper_square(&shown.1);
    for seconds in [0.5, 1.0, 1.25] {
        set(&mut shown.0, |playback| playback.seconds = seconds);
        draw(&mut shown);
        let at = upper_square(&shown.1);
        assert_eq!((click(&mut shown, at), at != before), (Some(0), true), "at {seconds}");
    }
    // The world of another moment is uploaded, and its picture is not drawn yet.
    let at = upper_square(&shown.1);
    set(&mut shown.0, |playback| playback.seconds = 0.0);
    let (session, gpu) = &mut shown;
    session.show_moment(gpu, Instant::now()).unwrap();
    assert_eq!(click(&mut shown, at), Some(0));
    draw(&mut shown);
    assert_eq!(click(&mut shown, at), None, "the square is elsewhere now");
}

#[test]
fn the_camera_of_the_file_moves_until_the_user_moves_it() {
    let mut shown = session();
    let eye_y = |shown: &(Session, GpuSession)| shown.0.controller.camera().eye.y;
    set(&mut shown.0, |playback| playback.seconds = 2.0);
    draw(&mut shown);
    assert_eq!(eye_y(&shown), 0.5);
    shown.0.controller.pan(0.1, 0.1);
    let moved = *shown.0.controller.camera();
    set(&mut shown.0, |playback| playback.seconds = 1.0);
    draw(&mut shown);
    assert_eq!(*shown.0.controller.camera(), moved);
    shown.0.controller.go_home();
    assert_eq!(eye_y(&shown), 0.25);
}

#[test]
fn a_moment_stays_while_it_is_to_be_saved() {
    let mut shown = session();
    let is_shown = |shown: &mut (Session, GpuSession)| {
        let (session, gpu) = shown;
        session.show_moment(gpu, Instant::now()).unwrap();
        !session.loaded.timeline.as_ref().unwrap().is_busy()
    };
    shown.0.is_save_due = true;
    set(&mut shown.0, |playback| playback.seconds = 1.0);
    assert!(!is_shown(&mut shown));
    shown.0.is_save_due = false;
    assert!(is_shown(&mut shown));
}
