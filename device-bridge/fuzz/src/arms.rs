//! What arms send.
use glam::DQuat;
use palpate_bridge::device::{
    Fault,
    falcon::wire::{self as falcon_wire, Frame, Frames},
    haply_2diy::wire::{self as haply_wire, Replies},
    hapticmaster::grammar::{self, Answer, LONGEST_ANSWER, LONGEST_TEXT},
    inverse3::wire as inverse3_wire,
    phantom::frame,
    serial::Lines,
    woodenhaptics::wire as woodenhaptics_wire,
};

fn is_unit(q: DQuat) -> bool {
    (q.length() - 1.0).abs() < 1e-9
}

/// An answer says the same in pieces as whole, what is garbled stays so, and no more is kept than the longest.
pub fn hapticmaster(bytes: &[u8]) -> bool {
    let (mut answer, mut vectors) = (Answer::new(), 0);
    for (wanted, ends_with_vector) in [(1, false), (3, true)] {
        answer.expect(wanted);
        if answer.take(bytes).is_err() {
            assert!(bytes.len() > LONGEST_ANSWER && answer.bytes().is_empty());
            return false;
        }
        let at_once = answer.whole(ends_with_vector).map(|text| text.map(str::to_owned));
        answer.expect(wanted);
        let mut is_garbled = false;
        for piece in bytes.chunks(bytes.len().div_ceil(16).max(1)) {
            assert_eq!(answer.take(piece), Ok(()));
            is_garbled |= answer.whole(ends_with_vector).is_err();
        }
        assert_eq!(answer.whole(ends_with_vector).map(|text| text.map(str::to_owned)), at_once);
        assert_eq!(at_once.is_err(), is_garbled, "what follows garbled bytes made them good");
        if let Ok(Some(text)) = at_once {
            vectors += hapticmaster_text(&text);
        }
    }
    vectors > 0
}

/// How many vectors are in it.
fn hapticmaster_text(text: &str) -> usize {
    let mut vectors = 0;
    let _ = grammar::is_refusal(text);
    for part in grammar::parts(text) {
        let truth = grammar::truth(part);
        let Some(v) = grammar::vector(part) else { continue };
        vectors += 1;
        assert!(v.is_finite() && truth.is_none(), "{part}");
        assert_eq!(grammar::vector(&format!("[{},{},{}]", v.x, v.y, v.z)), Some(v));
    }
    let (mut framed, mut answer) = (Vec::new(), Answer::new());
    assert_eq!(grammar::frame(text.as_bytes(), &mut framed), text.len() <= LONGEST_TEXT);
    if text.len() <= LONGEST_TEXT {
        answer.expect(1);
        assert_eq!(answer.take(&framed), Ok(()));
        assert_eq!(answer.whole(false), Ok(Some(text)));
    }
    vectors
}

/// Numbers that were read are written as a line that says the same; what is no fault leaves the next line readable.
pub fn woodenhaptics(bytes: &[u8]) -> bool {
    const GOOD: [i16; woodenhaptics_wire::NUMBERS] = [1, -2, 3, -32_768, 32_767, 0, -25_536];
    let mut lines = Lines::default();
    let mut take = |byte| -> Result<_, Fault> { lines.take(byte)?.map(woodenhaptics_wire::parse).transpose() };
    let (mut line, mut count) = (Vec::new(), 0);
    for &byte in bytes {
        match take(byte) {
            Ok(None) => {}
            Ok(Some(numbers)) => {
                count += 1;
                woodenhaptics_wire::write(numbers, &mut line);
                assert!(line.len() <= woodenhaptics_wire::LONGEST);
                assert_eq!(woodenhaptics_wire::parse(&line), Ok(numbers));
            }
            Err(fault) => {
                assert_eq!(fault, Fault::Garbled);
                return false;
            }
        }
    }
    // Its end ends what was begun, which may be no line.
    if take(b'\n').is_ok() {
        woodenhaptics_wire::write(GOOD, &mut line);
        let found: Vec<_> = line.iter().map(|&byte| take(byte)).collect();
        assert_eq!(found.last(), Some(&Ok(Some(GOOD))));
    }
    count > 0
}

/// Every answer is nine bytes of the stream, and its angles are those of no more than two turns.
pub fn haply_2diy(bytes: &[u8]) -> bool {
    let id = bytes.first().copied().unwrap_or(5);
    let (mut replies, mut count) = (Replies::new(id), 0);
    for (place, &byte) in bytes.iter().enumerate() {
        match replies.take(byte) {
            Ok(None) => {}
            Ok(Some(angles_deg)) => {
                count += 1;
                assert!(angles_deg.iter().all(|angle| angle.abs() <= 720.0), "{angles_deg:?}");
                let again = haply_wire::reply(id, angles_deg.map(|angle| angle as f32));
                assert_eq!(again, bytes[place + 1 - haply_wire::REPLY..=place]);
            }
            Err(fault) => {
                assert_eq!((fault, (place + 1) % haply_wire::REPLY), (Fault::Garbled, 0));
                return false;
            }
        }
    }
    assert_eq!(count, bytes.len() / haply_wire::REPLY);
    count > 0
}

/// Frames that were read are written as frames that say the same; a stream that has not begun yet can still begin.
pub fn falcon(bytes: &[u8]) -> bool {
    /// So many bytes may come before the first frame, three good ones left out.
    const BEFORE: usize = 256 - 3 * falcon_wire::FRAME;
    const GOOD: Frame = Frame { numbers: [1, -2, 30_000], flags: falcon_wire::HOMED };
    let (mut frames, mut count) = (Frames::default(), 0);
    for (place, &byte) in bytes.iter().enumerate() {
        let found = frames.take(byte);
        if place + 1 == falcon_wire::FRAME
            && let Some(Ok(first)) = bytes.first_chunk().map(Frame::parse)
        {
            assert_eq!(found, Ok(Some(first)), "the stream began with it");
        }
        match found {
            Ok(None) => {}
            Ok(Some(frame)) => {
                count += 1;
                let mut came: [u8; falcon_wire::FRAME] =
                    std::array::from_fn(|i| bytes[place + 1 + i - falcon_wire::FRAME]);
                assert_eq!(Frame::parse(&came), Ok(frame));
                // What nobody knows is not said again.
                came[14] = b'A';
                assert_eq!(frame.bytes(), came);
            }
            Err(fault) => {
                assert_eq!(fault, Fault::Garbled);
                assert!(count > 0 || bytes.len() > 256);
                return false;
            }
        }
    }
    if count == 0 && bytes.len() <= BEFORE {
        let found: Vec<_> = GOOD.bytes().repeat(3).into_iter().map(|byte| frames.take(byte)).collect();
        assert_eq!(found.last(), Some(&Ok(Some(GOOD))));
    }
    count > 0
}

/// A state is one of an arm that the same message tells of, within reach; a grip's rotation is one.
pub fn inverse3(bytes: &[u8]) -> bool {
    let (arms, mut grips) = (inverse3_wire::arms(bytes), 0);
    for (arm, grip) in [("049D", ""), ("049D", "61548"), ("", "")] {
        let state = match inverse3_wire::state(bytes, arm, grip) {
            Ok(state) => state,
            Err(Fault::Disconnected) => {
                assert!(arms.as_ref().is_ok_and(|arms| arms.iter().all(|found| found.device_id != arm)));
                continue;
            }
            Err(fault) => {
                assert_eq!(fault, Fault::Garbled);
                continue;
            }
        };
        assert!(arms.as_ref().is_ok_and(|arms| arms.iter().any(|found| found.device_id == arm)));
        grips += usize::from(state.grip.is_some());
        assert!(state.position_m.abs().max_element() <= 10.0, "{state:?}");
        assert!(state.velocity_m_per_s.abs().max_element() <= 100.0, "{state:?}");
        assert!(state.grip.is_none_or(|grip| grip.buttons < 8 && grip.orientation.is_none_or(is_unit)), "{state:?}");
    }
    grips > 0
}

/// Whatever numbers libHD says: a pose is finite and its rotation is one, and every code of an error is a fault.
pub fn phantom(bytes: &[u8]) -> bool {
    let mut words =
        bytes.chunks_exact(8).map(|word| word.try_into().map_or(0, u64::from_le_bytes)).chain([0].into_iter().cycle());
    let mut word = || words.next().unwrap_or(0);
    let buttons = word() as u32;
    let _ = frame::fault(buttons);
    let mut number = || f64::from_bits(word());
    let position = std::array::from_fn(|_| number());
    let velocity = std::array::from_fn(|_| number());
    let transform = std::array::from_fn(|_| number());
    let angular = std::array::from_fn(|_| number());
    let pose = frame::pose(position, velocity, transform, angular, buttons.cast_signed());
    assert!(pose.is_none_or(|pose| pose.motion.is_finite() && is_unit(pose.motion.orientation)), "{pose:?}");
    assert!(pose.is_none_or(|pose| pose.buttons == buttons), "{pose:?}");
    pose.is_some()
}
