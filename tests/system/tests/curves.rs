//! The same press on the heart by every arm: the force over time is that of the simulated arm.
#![allow(clippy::unwrap_used)] // a test that cannot start its subject has failed
mod lab;
#[path = "../../../device-bridge/tests/common/libhd.rs"]
mod libhd;

use lab::{
    Bridge,
    arms::{self, Emulated, Hand},
};
use palpate_bridge::config::RecordConfig;
use palpate_system_tests::daemon::Daemon;
use std::{fs, path::Path, time::Duration};

/// Into the ventricle's wall, a rest, and out again.
fn hand(period_s: f64) -> Hand {
    let keys = [(0.0, 0.045), (0.1, 0.045), (0.5, 0.026), (0.6, 0.026), (0.9, 0.045)];
    Hand { keys: keys.map(|(share, x_m)| (share * period_s, x_m)).to_vec(), period_s }
}

/// A period of the press, a value a millisecond.
struct Curve {
    force_n: Vec<f64>,
    /// Where the arm was along the press (m).
    place_m: Vec<f64>,
}

impl Curve {
    /// The last whole period of a recording but for what the bridge's end takes away.
    fn of(recording: &Path, period_s: f64) -> Self {
        let text = fs::read_to_string(recording).unwrap();
        let mut lines = text.lines();
        let names: Vec<&str> = lines.next().unwrap().split(',').collect();
        let columns = ["time_s", "position_x_m", "force_x_n", "force_y_n", "force_z_n"]
            .map(|name| names.iter().position(|known| *known == name).unwrap());
        // Time, place and force.
        let rows: Vec<[f64; 3]> = lines
            .map(|line| {
                let words: Vec<&str> = line.split(',').collect();
                let [time_s, place_m, x, y, z] = columns.map(|column| words[column].parse::<f64>().unwrap());
                [time_s, place_m, glam::DVec3::new(x, y, z).length()]
            })
            .collect();
        let end_s = rows.last().unwrap()[0] - 0.1;
        // In the first period the force comes up.
        assert!(end_s > 2.0 * period_s, "{end_s} s recorded");
        let at = |time_s: f64, column: usize| {
            let after = rows.partition_point(|row| row[0] <= time_s).clamp(1, rows.len() - 1);
            let (before, after) = (rows[after - 1], rows[after]);
            let share = ((time_s - before[0]) / (after[0] - before[0])).clamp(0.0, 1.0);
            before[column] + (after[column] - before[column]) * share
        };
        let times = || (0..(1e3 * period_s) as u32).map(|ms| end_s - period_s + f64::from(ms) * 1e-3);
        Self { place_m: times().map(|t| at(t, 1)).collect(), force_n: times().map(|t| at(t, 2)).collect() }
    }

    fn peak_n(&self) -> f64 {
        self.force_n.iter().copied().fold(0.0, f64::max)
    }

    /// This curve, shifted in time so that the arm is at the same places as in another.
    fn laid_over(&self, other: &Self) -> Self {
        let n = self.force_n.len();
        let shifted = |values: &[f64], by: usize| (0..n).map(|i| values[(i + by) % n]).collect::<Vec<_>>();
        let apart_m2 = |by: usize| (0..n).map(|i| (self.place_m[(i + by) % n] - other.place_m[i]).powi(2)).sum::<f64>();
        let by = (0..n).min_by(|a, b| apart_m2(*a).total_cmp(&apart_m2(*b))).unwrap();
        Self { force_n: shifted(&self.force_n, by), place_m: shifted(&self.place_m, by) }
    }

    /// The median force at each place of an odd number of curves that lie over one another: where the machine was late in one of them, the others
    /// have the force.
    fn median(curves: &[Self]) -> Self {
        let at = |i: usize| {
            let mut forces: Vec<f64> = curves.iter().map(|curve| curve.force_n[i]).collect();
            forces.sort_by(f64::total_cmp);
            forces[forces.len() / 2]
        };
        Self { force_n: (0..curves[0].force_n.len()).map(at).collect(), place_m: curves[0].place_m.clone() }
    }

    /// How far (N) this is from another that it lies over: root mean square, without the fiftieth of ticks that are farthest apart (a
    /// machine that runs tests is late now and then, and a late tick has less force), and the least distance of those.
    fn apart_n(&self, other: &Self) -> (f64, f64) {
        let mut apart: Vec<f64> = self.force_n.iter().zip(&other.force_n).map(|(a, b)| (a - b).abs()).collect();
        apart.sort_by(f64::total_cmp);
        let near = &apart[..apart.len() - apart.len() / 50];
        ((near.iter().map(|d| d * d).sum::<f64>() / near.len() as f64).sqrt(), near[near.len() - 1])
    }
}

/// The curve of an arm on the ventricle; none if its force was taken away meanwhile, since the machine stood still for longer than a
/// bridge waits for answers.
fn pressed(daemon: &Daemon, arm: &Emulated, period_s: f64, recording: &Path) -> Option<Curve> {
    let mut config = lab::config(&daemon.url, arm.device.clone());
    config.workspace = arms::workspace();
    // Forces are compared here, and not how a machine keeps time: one that stands still for a moment keeps its force.
    config.watchdog.fresh_for_s = 0.1;
    config.watchdog.stale_after_s = 0.2;
    config.record = RecordConfig { path: Some(recording.to_owned()), overwrite: true };
    let bridge = Bridge::start(config);
    bridge.wait("it presses", |handle| handle.stats().force_n() > 0.3);
    std::thread::sleep(Duration::from_secs_f64(2.15 * period_s));
    let summary = bridge.stop().unwrap();
    println!("{summary}");
    daemon.wait_until("the tool is free", |status| status["devices"].as_array().is_some_and(Vec::is_empty));
    (summary.latched == 0).then(|| Curve::of(recording, period_s))
}

/// A machine that runs tests stands still now and then: answers come late, and where none comes in time the force is gone for 0.7 s. So often is a
/// press tried.
const TRIES: usize = 11;
/// Presses among which the simulated arm's force is to come twice.
const PRESSES: usize = 22;

/// Presses until the force of a press, or the median of all so far, is that of `expected`, but for `most` of the peak (root mean
/// square).
fn judge(name: &str, expected: &Curve, most: f64, press: impl Fn() -> Option<Curve>) {
    let expected_n = expected.peak_n();
    assert!(expected_n > 0.5, "it presses");
    let (mut least_n, mut pressed) = (f64::INFINITY, Vec::new());
    for _ in 0..TRIES {
        let Some(curve) = press() else { continue };
        pressed.push(curve.laid_over(expected));
        let last = &pressed[pressed.len() - 1];
        // Of an even number of presses there is no middle one.
        let median = (pressed.len() % 2 == 1).then(|| Curve::median(&pressed));
        for (what, curve) in std::iter::once(("this press", last)).chain(median.iter().map(|all| ("all presses", all)))
        {
            let (rms_n, farthest_n) = curve.apart_n(expected);
            println!(
                "{name}, {what}: peak {:.3} N of {expected_n:.3}; apart by {rms_n:.4} N (root mean square), by less than {farthest_n:.3} N in 98 of 100 ticks",
                curve.peak_n()
            );
            least_n = least_n.min(rms_n);
        }
        if least_n <= most * expected_n {
            return;
        }
    }
    panic!("{name}: {least_n} N apart at best, of {expected_n} N");
}

/// The curve of the simulated arm: one that comes twice, whatever came between; or the median of some presses that is also the
/// median of as many others.
fn expected(daemon: &Daemon, hand: &Hand, recording: &Path) -> Curve {
    let mut earlier: Vec<Curve> = Vec::new();
    for _ in 0..PRESSES {
        let Some(curve) = pressed(daemon, &arms::simulated(hand), hand.period_s, recording) else { continue };
        let same = |a: &Curve, b: &Curve| a.laid_over(b).apart_n(b).0 < 5e-3 * a.peak_n();
        if earlier.iter().any(|before| same(&curve, before)) {
            return curve;
        }
        earlier.push(match earlier.first() {
            Some(first) => curve.laid_over(first),
            None => curve,
        });
        // Medians are of odd numbers of presses: of the first three and the last three of six, of five and five of ten, and so on.
        let (first, last) = earlier.split_at(earlier.len() / 2);
        if first.len() >= 3 && first.len() == last.len() && first.len() % 2 == 1 {
            let (first, last) = (Curve::median(first), Curve::median(last));
            if same(&last, &first) {
                return last;
            }
        }
    }
    panic!(
        "of {PRESSES} presses of the simulated arm {} kept their force, and it was not the same twice",
        earlier.len()
    );
}

#[test]
fn every_arm_gives_the_force_curve_of_the_simulated_arm_on_the_heart() {
    let folder = tempfile::tempdir().unwrap();
    let daemon = Daemon::start(&["--arm", "none", &lab::light_ventricle(folder.path())]);
    let file = |name: &str| folder.path().join(name);
    let libhd = file("libHD.so");
    fs::copy(libhd::built(), &libhd).unwrap();
    // An arm that is a mass of 2 kg wants a slow hand.
    let (quick, slow) = (hand(2.5), hand(4.0));
    let recorded = file("simulated.csv");
    let of_simulated = expected(&daemon, &quick, &recorded);
    let all: [(&str, &dyn Fn() -> Emulated); 7] = [
        ("woodenhaptics", &|| arms::woodenhaptics(&quick)),
        ("haply-2diy", &|| arms::haply_2diy(&quick)),
        ("falcon", &|| arms::falcon(&quick)),
        ("inverse3", &|| arms::inverse3(&quick)),
        ("vrpn", &|| arms::vrpn(&quick)),
        ("phantom", &|| arms::phantom(&quick, &libhd)),
        ("playback", &|| arms::playback(&recorded)),
    ];
    for (name, arm) in all {
        let press = || pressed(&daemon, &arm(), quick.period_s, &file("arm.csv"));
        judge(name, &of_simulated, 0.02, press);
    }
    let of_simulated = expected(&daemon, &slow, &file("slow.csv"));
    for (plane, name) in [(false, "hapticmaster"), (true, "hapticmaster, its own plane")] {
        let press = || pressed(&daemon, &arms::hapticmaster(&slow, plane), slow.period_s, &file("arm.csv"));
        judge(name, &of_simulated, 0.05, press);
    }
}
