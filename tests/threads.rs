//! Several threads use one device at once. Each gets the bits that it gets alone, and the validation layer, which also
//! watches what threads share, is silent.

mod support;

use std::{
    panic::{AssertUnwindSafe, catch_unwind},
    sync::Barrier,
    thread,
};

use glam::Vec3;
use kdray::{
    accel::Query,
    cast::{GpuCaster, Hit, Ray, RecordedCast},
    engine::{self, Engine},
    frame::{Goal, Integrator, Picture, RenderOptions},
    gpu::{Access, Buffer, BufferUse, CommandBuffer, Commands, Device},
    render,
    scene::Camera,
    world::World,
};
use support::{
    devices::{assert_silent, device},
    scenes, world_of,
};

const N_THREADS: usize = 3;
const N_RUNS: usize = 2;

fn options(integrator: Integrator) -> RenderOptions {
    RenderOptions { width: 16, height: 12, max_depth: 2, integrator, ..RenderOptions::default() }
}

fn world() -> World {
    world_of(&scenes::mixed())
}

/// Rays from the camera in slightly different directions.
fn rays(camera: &Camera) -> Vec<Ray> {
    let towards = camera.target - camera.eye;
    let direction = |i: usize| towards + 0.01 * Vec3::new((i % 17) as f32, (i % 5) as f32, (i % 3) as f32);
    let ray = |i| Ray { origin: camera.eye, t_min: 0.0, direction: direction(i), t_max: f32::INFINITY };
    (0..300).map(ray).collect()
}

/// Renders and casts rays.
fn work(engine: &Engine, world: &World, integrator: Integrator) -> (Picture, Vec<Hit>) {
    let picture = engine.render(world, &options(integrator)).expect("a picture").picture;
    (picture, engine.cast(world, &rays(&world.scene().camera), Query::Closest).expect("hits"))
}

/// Lets threads do the same at the same time, each `N_RUNS` times. Returns what each of them gets.
fn at_once<T: Send>(body: impl Fn(usize) -> T + Sync) -> Vec<T> {
    let begin = Barrier::new(N_THREADS);
    let run = |thread_ix| {
        begin.wait();
        (0..N_RUNS).map(|_| body(thread_ix)).collect::<Vec<_>>()
    };
    thread::scope(|scope| {
        let threads: Vec<_> = (0..N_THREADS).map(|thread_ix| scope.spawn(move || run(thread_ix))).collect();
        threads.into_iter().flat_map(|thread| thread.join().expect("no panic")).collect()
    })
}

#[test]
fn clones_of_an_engine_render_and_cast_at_once() {
    let context = device();
    let engine = Engine::on_device(&context);
    let world = world();
    let integrators = [Integrator::Whitted, Integrator::Path];
    let alone = integrators.map(|integrator| work(&engine, &world, integrator));
    let clones: Vec<_> = (0..N_THREADS).map(|_| engine.clone()).collect();
    let drawn = at_once(|thread_ix| (thread_ix % 2, work(&clones[thread_ix], &world, integrators[thread_ix % 2])));
    for (kind, together) in drawn {
        assert!(together == alone[kind], "the same bits as alone");
    }
    assert_silent(&context);
}

/// Renderers of one engine, one in each thread, keep drawing. Every second thread replaces its renderer halfway.
#[test]
fn renderers_of_an_engine_draw_at_once() {
    let context = device();
    let engine = Engine::on_device(&context);
    let world = world();
    let draw = |renderer: &mut engine::Renderer| {
        renderer.draw(&world.scene().camera, Goal::Samples(2), || ()).expect("samples");
        renderer.picture().expect("a picture").into_owned()
    };
    let new = || engine.renderer(&world, &options(Integrator::Whitted)).expect("a renderer");
    let alone = draw(&mut new());
    let drawn = at_once(|thread_ix| {
        let mut renderer = new();
        let first = draw(&mut renderer);
        if thread_ix % 2 == 1 {
            renderer = new();
        }
        [first, draw(&mut renderer)]
    });
    assert!(drawn.iter().flatten().all(|picture| *picture == alone));
    assert_silent(&context);
}

#[test]
fn an_engine_may_have_the_same_device_twice() {
    let context = device();
    let engine = Engine::on_device(&context);
    let (world, options) = (world(), options(Integrator::Path));
    let draw = |engine: &Engine| {
        let mut renderer = engine.renderer(&world, &options).expect("a renderer");
        renderer.draw(&world.scene().camera, Goal::Samples(64), || ()).expect("samples");
        renderer.picture().expect("a picture").into_owned()
    };
    let device = Device::from(&context);
    let twice = Engine::on_devices(vec![device.clone(), device]);
    assert!(draw(&twice) == draw(&engine));
    assert_silent(&context);
}

/// Nobody holds the queue while the device works: all threads have submitted before the first of them waits.
#[test]
fn submissions_of_threads_overlap() {
    let context = device();
    let have_submitted = Barrier::new(N_THREADS);
    let submit_and_wait = || {
        let buffer = Buffer::with(&context, "numbers", &[7u32; 1000], BufferUse::Storage).expect("a buffer");
        let fill = |commands: &Commands| {
            commands.fill_buffer(buffer.any(), 3);
            commands.barrier(Access::TransferWrite, Access::ComputeWrite); // numbers, before the download
        };
        let commands = CommandBuffer::record(&context, "fill", None, fill).expect("commands");
        let submission = context.submit(vec![commands]).expect("a submission");
        have_submitted.wait();
        context.wait_for(submission).expect("the end");
        buffer.download().expect("numbers")
    };
    thread::scope(|scope| {
        let threads: Vec<_> = (0..N_THREADS).map(|_| scope.spawn(submit_and_wait)).collect();
        threads.into_iter().for_each(|thread| assert_eq!(thread.join().expect("no panic"), [3; 1000]));
    });
    assert!(context.most_in_flight() as usize >= N_THREADS, "{} at once", context.most_in_flight());
    assert_silent(&context);
}

#[test]
fn a_panic_of_one_thread_leaves_the_others_their_device() {
    let context = device();
    let engine = Engine::on_device(&context);
    let world = world();
    let work = || work(&engine, &world, Integrator::Whitted);
    let alone = work();
    let drawn = at_once(|thread_ix| {
        if thread_ix == 0 {
            let mut renderer = engine.renderer(&world, &options(Integrator::Whitted)).expect("a renderer");
            let watcher = || -> () { panic!("of the watcher") };
            let draw = || renderer.draw(&world.scene().camera, Goal::Samples(2), watcher).map(drop);
            assert!(catch_unwind(AssertUnwindSafe(draw)).is_err());
            return None;
        }
        Some(work())
    });
    assert!(drawn.iter().flatten().all(|work| *work == alone));
    assert!(work() == alone, "and so does the next call");
    assert_silent(&context);
}

/// What may go to another thread, and what several threads may use at once.
#[test]
fn threads_may_have_everything() {
    fn send<T: Send>() {}
    fn sync<T: Send + Sync>() {}
    sync::<Device>();
    sync::<Engine>();
    sync::<World>();
    sync::<GpuCaster>();
    sync::<RecordedCast>();
    sync::<engine::Caster>();
    sync::<engine::Renderer>();
    sync::<render::GpuRenderer>();
    send::<engine::FilmRenderer>();
}
