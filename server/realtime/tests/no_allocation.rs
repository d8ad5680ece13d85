//! A running loop touches no heap: deadlines, slots, histograms, doorbell.
use assert_no_alloc::{AllocDisabler, assert_no_alloc};
use palpate_realtime::{Clock, Doorbell, TickLoop, slot};
use std::ops::ControlFlow;

#[global_allocator]
static ALLOCATOR: AllocDisabler = AllocDisabler;

#[test]
fn the_loop_allocates_nothing() {
    let (mut up, mut up_reader) = slot(&[0.0_f64; 32]);
    let bell = Doorbell::new().unwrap();
    let mut tick_loop = TickLoop::new(Clock::Monotonic, 2e-4).unwrap();
    let monitor = tick_loop.monitor();
    let mut sum = 0.0;
    assert_no_alloc(|| {
        tick_loop.run(|wakeup| {
            up.buffer().fill(wakeup.tick as f64);
            up.publish_buffer();
            bell.ring();
            bell.answer();
            sum += up_reader.take().map_or(0.0, |value| value[0]);
            if wakeup.tick >= 200 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
    });
    assert!(sum > 0.0 && monitor.ticks() > 0);
}
