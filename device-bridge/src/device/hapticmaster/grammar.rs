//! What goes over the wire to a HapticMASTER, and what comes back: bytes in, bytes out, no socket.
//!
//! A request is 8 bytes, all zero but the fourth, the number of bytes that follow, and that many ASCII characters: commands with `;` between them. Every request has
//! one answer. Public sources do not settle whether an answer begins with the same 8 bytes: both are taken, told apart by the first byte, which is never 0 in
//! ASCII. One without them has no end of its own; it is whole when it has an answer for every command of the request and the last is closed, by the vector that requests
//! in the loop end with; one that ends otherwise may go on, and is over when nothing more comes ([`Answer::tells_its_end`]).
use super::super::Fault;
use glam::DVec3;

/// Bytes before a request's text.
pub const HEADER_BYTES: usize = 8;
/// Longest text: its length is one byte.
pub const LONGEST_TEXT: usize = 255;
/// Longest answer that is waited for; a device that sends more speaks another language.
pub const LONGEST_ANSWER: usize = 2048;

/// Puts a request with this text into `bytes`, which has room for it; nothing, and false, when the text is too long.
pub fn frame(text: &[u8], bytes: &mut Vec<u8>) -> bool {
    bytes.clear();
    let Ok(length) = u8::try_from(text.len()) else { return false };
    bytes.extend_from_slice(&[0, 0, 0, length, 0, 0, 0, 0]);
    bytes.extend_from_slice(text);
    true
}

/// Collects the bytes of one answer.
#[derive(Debug)]
pub struct Answer {
    bytes: Vec<u8>,
    /// Answers wanted, one for each command.
    parts: usize,
}

impl Answer {
    /// With room for the longest.
    pub fn new() -> Self {
        Self { bytes: Vec::with_capacity(LONGEST_ANSWER + 1), parts: 0 }
    }

    /// Waits for the answer to a request of so many commands; forgets what was there.
    pub fn expect(&mut self, parts: usize) {
        self.bytes.clear();
        self.parts = parts;
    }

    /// Takes bytes; allocates nothing.
    ///
    /// # Errors
    /// [`Fault::Garbled`] when there are more than any answer has.
    pub fn take(&mut self, bytes: &[u8]) -> Result<(), Fault> {
        if self.bytes.len() + bytes.len() > LONGEST_ANSWER {
            return Err(Fault::Garbled);
        }
        self.bytes.extend_from_slice(bytes);
        Ok(())
    }

    /// What has come.
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// Whether it began with a header, which tells its end.
    fn has_header(&self) -> bool {
        self.bytes.first() == Some(&0)
    }

    /// Whether what [`Self::whole`] gives is all of it; else it may go on for as long as bytes come.
    pub fn tells_its_end(&self, ends_with_vector: bool) -> bool {
        ends_with_vector || self.has_header()
    }

    /// The answer's text, once it is whole. `ends_with_vector`: the last command asks for one, which tells the end of an answer without a header.
    ///
    /// # Errors
    /// [`Fault::Garbled`]: a header that is none, bytes behind the end, or bytes that are not ASCII.
    pub fn whole(&self, ends_with_vector: bool) -> Result<Option<&str>, Fault> {
        let text = match *self.bytes {
            [] => return Ok(None),
            [0, ..] if self.bytes.len() < HEADER_BYTES => return Ok(None),
            [0, a, b, length, c, d, e, f, ref text @ ..] => {
                if [a, b, c, d, e, f] != [0; 6] || text.len() > usize::from(length) {
                    return Err(Fault::Garbled);
                }
                if text.len() < usize::from(length) {
                    return Ok(None);
                }
                text
            }
            _ if !self.bytes.is_ascii() => return Err(Fault::Garbled),
            _ => {
                let parts = self.bytes.split(|&byte| byte == b';').count();
                let closed = !ends_with_vector || self.bytes.trim_ascii_end().ends_with(b"]");
                let refused = self.bytes.windows(ERROR.len()).any(|w| w == ERROR.as_bytes());
                // A final `;` closes as well as it separates.
                let trailing = usize::from(self.bytes.trim_ascii_end().ends_with(b";"));
                if !refused && (parts - trailing < self.parts || !(closed || trailing == 1)) {
                    return Ok(None);
                }
                &self.bytes
            }
        };
        match std::str::from_utf8(text) {
            Ok(text) if text.is_ascii() => Ok(Some(text)),
            _ => Err(Fault::Garbled),
        }
    }
}

impl Default for Answer {
    fn default() -> Self {
        Self::new()
    }
}

/// What every refusal contains.
const ERROR: &str = "--- ERROR";

/// Whether an answer says that a command was refused.
pub fn is_refusal(answer: &str) -> bool {
    answer.contains(ERROR)
}

/// The answers to the commands of a request, without the space around them, quotation marks and the final `;` of some versions.
pub fn parts(answer: &str) -> impl Iterator<Item = &str> {
    answer.trim().trim_end_matches(';').split(';').map(|part| part.trim().trim_matches('"').trim())
}

/// A vector `[x,y,z]`, finite.
pub fn vector(part: &str) -> Option<DVec3> {
    let mut components = part.strip_prefix('[')?.strip_suffix(']')?.split(',').map(|text| text.trim().parse::<f64>());
    let mut next = || components.next()?.ok().filter(|component| component.is_finite());
    let found = DVec3::new(next()?, next()?, next()?);
    components.next().is_none().then_some(found)
}

/// A truth value, in either dialect.
pub fn truth(part: &str) -> Option<bool> {
    match part {
        "true" => Some(true),
        "false" => Some(false),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn framed(text: &str) -> Vec<u8> {
        let mut bytes = Vec::new();
        assert!(frame(text.as_bytes(), &mut bytes));
        bytes
    }

    #[test]
    fn a_request_has_its_length_in_the_fourth_byte() {
        assert_eq!(framed("get state"), b"\0\0\0\x09\0\0\0\0get state");
        assert!(!frame(&[b'x'; 256], &mut Vec::new()));
    }

    #[test]
    fn an_answer_is_whole_with_a_header_and_without() {
        let text = "Force set;[0.1,-0.2,3e-05];[0,0,0]";
        for bytes in [framed(text), text.as_bytes().to_vec()] {
            for cut in 0..bytes.len() {
                let mut answer = Answer::new();
                answer.expect(3);
                answer.take(&bytes[..cut]).unwrap();
                assert_eq!(answer.whole(true).unwrap(), None, "{cut} of {}", bytes.len());
                answer.take(&bytes[cut..]).unwrap();
                assert_eq!(answer.whole(true).unwrap(), Some(text));
            }
        }
        let vectors: Vec<_> = parts(text).map(vector).collect();
        assert_eq!(vectors, [None, Some(DVec3::new(0.1, -0.2, 3e-5)), Some(DVec3::ZERO)]);
    }

    #[test]
    fn both_dialects_say_the_same() {
        for answer in ["false;", "\"false\"", " false "] {
            assert_eq!(parts(answer).map(truth).collect::<Vec<_>>(), [Some(false)], "{answer}");
        }
        assert_eq!(parts("\"stop\"").collect::<Vec<_>>(), ["stop"]);
        assert!(is_refusal("--- ERROR: unknown command") && !is_refusal("state set to 'force'"));
    }

    #[test]
    fn vectors_that_are_none_are_refused() {
        for bad in ["[1,2]", "[1,2,3,4]", "[1,2,nan]", "[1,2,inf]", "1,2,3", "[1,2,3", "[a,b,c]", ""] {
            assert_eq!(vector(bad), None, "{bad}");
        }
    }

    #[test]
    fn a_header_that_is_none_and_too_many_bytes_are_garbled() {
        let mut answer = Answer::new();
        answer.expect(1);
        answer.take(b"\0\0\x01\x04\0\0\0\0true").unwrap();
        assert_eq!(answer.whole(false), Err(Fault::Garbled));
        answer.expect(1);
        answer.take(b"\0\0\0\x03\0\0\0\0true").unwrap();
        assert_eq!(answer.whole(false), Err(Fault::Garbled), "a byte behind the end");
        answer.expect(1);
        assert_eq!(answer.take(&[b'x'; LONGEST_ANSWER + 1]), Err(Fault::Garbled));
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 4000, ..ProptestConfig::default() })]
        #[test]
        fn nothing_panics_on_any_bytes(bytes in prop::collection::vec(any::<u8>(), 0..300), wanted in 0_usize..6, ends: bool) {
            let mut answer = Answer::new();
            answer.expect(wanted);
            for part in bytes.chunks(7) {
                answer.take(part).unwrap();
                if let Ok(Some(text)) = answer.whole(ends) {
                    for part in parts(text) {
                        let _ = (vector(part), truth(part));
                    }
                }
            }
        }

        #[test]
        fn every_finite_vector_comes_back(x in -1e3_f64..1e3, y in -1e3_f64..1e3, z in -1e-6_f64..1e-6) {
            let v = DVec3::new(x, y, z);
            prop_assert_eq!(vector(&format!("[{x},{y},{z}]")), Some(v));
        }
    }
}
