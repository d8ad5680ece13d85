//! Base64 as VTK writes it: pieces, each with its own padding, one behind the other.

/// Decodes until `wanted` bytes are there or the text ends. A character that is no base64 ends with its place as error.
pub(super) fn decode(text: &[u8], wanted: usize) -> Result<Vec<u8>, usize> {
    let mut bytes = Vec::new();
    let (mut bits, mut have) = (0u32, 0u32);
    for (place, &character) in text.iter().enumerate() {
        let value = match character {
            b'A'..=b'Z' => character - b'A',
            b'a'..=b'z' => character - b'a' + 26,
            b'0'..=b'9' => character - b'0' + 52,
            b'+' => 62,
            b'/' => 63,
            // Padding ends a piece: the bits left belong to no byte.
            b'=' => {
                (bits, have) = (0, 0);
                continue;
            }
            _ if character.is_ascii_whitespace() => continue,
            _ => return Err(place),
        };
        bits = (bits << 6 | u32::from(value)) & 0xffff;
        have += 6;
        if have >= 8 {
            have -= 8;
            bytes.push((bits >> have) as u8);
            if bytes.len() == wanted {
                break;
            }
        }
    }
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::decode;

    #[test]
    fn known_values() {
        // RFC 4648, section 10.
        let cases: [(&[u8], &[u8]); 4] =
            [(b"Zg==", b"f"), (b"Zm8=", b"fo"), (b"Zm9v", b"foo"), (b"Zm9vYmFy", b"foobar")];
        for (text, bytes) in cases {
            assert_eq!(decode(text, usize::MAX).unwrap(), bytes);
        }
        assert_eq!(decode(b"Zg==\n Zm8=Zm9v", usize::MAX).unwrap(), b"ffofoo");
        assert_eq!(decode(b"Zm9vYmFy", 4).unwrap(), b"foob");
        assert_eq!(decode(b"Zm9v!", usize::MAX), Err(4));
    }
}
