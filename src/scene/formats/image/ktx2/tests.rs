//! Files of the encoder of Basis Universal, decoded as its own transcoder decodes them, then cut off and spoilt.

use base64::prelude::{BASE64_STANDARD, Engine};

use super::*;

/// 8 x 8 pixels in ETC1S with opacity, as `basisu -ktx2` 1.15 writes them.
const ETC1S: &str = "\
    q0tUWCAyMLsNChoKAAAAAAEAAAAIAAAACAAAAAAAAAAAAAAAAQAAAAEAAAABAAAAaAAAADwAAACkAAAAJAAAAMgAAAAAAAAAoQAAAAAAAABp\
    AQAAAAAAAAUAAAAAAAAAAAAAAAAAAAA8AAAAAAAAAAIAOACjAQIAAwMAAAAAAAAAAAAAAAA/AAAAAAAAAAAA/////0AAPw8AAAAAAAAAAP//\
    //8fAAAAS1RYd3JpdGVyAEJhc2lzIFVuaXZlcnNhbCAxLjE1AAAHAAUANQAAABUAAAAvAAAAAAAAAAAAAAAAAAAAAgAAAAIAAAADAAAAFMAU\
    AAAAACAAZHYBAkQJAAAAAARh5ADVCGBCgAAAAAAI6oAQATABIAAAAACApHUN/iwQUAEEqlT/h6Isz4ckTdcHoErVB6BK9QcAwUQAAAAAAADy\
    X60AmAAgAAAAAIFcTIAIAQIAAIAgipzQBAOACQAAAAAAAAQQAAJGLrsA\
";

/// The pixels of [`ETC1S`] as the transcoder of Basis Universal decodes them.
const ETC1S_PIXELS: &str = "\
    BwdRBwcHUQcHB1EkJCRuPpMHUUmTB1FJkwdRZrAkboAkJG4HJCRuJCQkbj4+Pog+sCRuSbAkbmawJG6Ayj6IgD4+iCQ+Pog+Pj6IPltbpVvK\
    Pohmyj6IgMo+iIDnW6WdW1ulPltbpT5bW6VbW1ulW+dbpYDnW6WA51ulnedbpZ0PpFpJD6RaSQ+kWmYPpFqApKRak6SkWpOkpFqwpKRasA+k\
    WkkswXdmLMF3gCzBd4CkpFqTwcF3sMHBd7DBwXfKLMF3ZkbbkYBG25GARtuRncHBd7Db25Gw29uRytvbkedG25GAY/iugGP4rp1j+K6d29uR\
    sPj4rsr4+K7n+Piu5w==\
";

/// 10 x 6 pixels in UASTC with opacity and Zstandard, as `basisu -ktx2 -uastc` 1.15 writes them.
const UASTC: &str = "\
    q0tUWCAyMLsNChoKAAAAAAEAAAAKAAAABgAAAAAAAAAAAAAAAQAAAAEAAAACAAAAaAAAACwAAACUAAAAJAAAAAAAAAAAAAAAAAAAAAAAAAC4\
    AAAAAAAAAFMAAAAAAAAAYAAAAAAAAAAsAAAAAAAAAAIAKACmAQIAAwMAAAAAAAAAAAAAAAB/AwAAAAAAAAAA/////x8AAABLVFh3cml0ZXIA\
    QmFzaXMgVW5pdmVyc2FsIDEuMTUAACi1L/0gYFUCAAQEaLOid8FA/EdDyFHZYupy+8+mYSOqwBF/AcAR/4Eq1X9PNmDjwAEQ/8GrEH/lcnJy\
    3xUvAQAUABQg4D+82t/fDwIAAMgzyFwC\
";

/// The pixels of [`UASTC`] as the transcoder of Basis Universal decodes them.
const UASTC_PIXELS: &str = "\
    AACD/04Ag/+hAIP/7wCD/wAAg/9OAIP/oQCD/+8Ag/8AAIj/VQCI/wBSg95OUoPeoVKD3u9Sg94AUoPeTlKD3qFSg97vUoPeAE6I/1VOiOkA\
    qIO6TqiDuqGog7rvqIO6AKiDuk6og7qhqIO676iDugCgiP9VoIjSAKiDuk76g5ih+oOY7/qDmACog7pO+oOYofqDmO/6g5gA7oj/Ve6IuwAA\
    iP9OAIj/oACI/+4AiP8AAIj/TgCI/6AAiP/uAIj/AACA/1AAgP8AVYj/TlWI6aBViNLuVYi7AFWI/05ViOmgVYjS7lWIuwBQgPBQUIDw\
";

fn bytes_of(base64: &str) -> Vec<u8> {
    BASE64_STANDARD.decode(base64).unwrap()
}

/// Reads a file as `decode_all` does.
fn read(bytes: &[u8]) -> Checked<Vec<u8>> {
    header_of(bytes)?;
    match decode(bytes)? {
        Pixels::Bytes(pixels) => Ok(pixels.into_flattened()),
        Pixels::Halves(_) => unreachable!("Basis Universal has bytes"),
    }
}

/// Returns a file with a changed word.
fn changed(file: &str, at: usize, word: u32) -> Vec<u8> {
    let mut bytes = bytes_of(file);
    bytes[at..at + 4].copy_from_slice(&word.to_le_bytes());
    bytes
}

#[test]
fn pixels_are_those_of_the_transcoder() {
    for (file, pixels, size) in [(ETC1S, ETC1S_PIXELS, [8, 8]), (UASTC, UASTC_PIXELS, [10, 6])] {
        let header = header_of(&bytes_of(file)).unwrap();
        assert_eq!(([header.width, header.height], header.is_linear), (size, false));
        assert_eq!(read(&bytes_of(file)).unwrap(), bytes_of(pixels));
    }
}

#[test]
fn files_that_are_cut_off_are_refused() {
    for file in [ETC1S, UASTC].map(bytes_of) {
        // The last byte of ETC1S may only fill up a word.
        for n in 0..file.len() - 1 {
            assert!(read(&file[..n]).is_err(), "{n} of {} bytes", file.len());
        }
    }
}

/// The decoder would allocate what the header states, or panic.
#[test]
fn sizes_are_checked_before_the_decoder_trusts_them() {
    let refused = |bytes: &[u8]| header_of(bytes).unwrap_err();
    let [levels, shared, end_of_keys] = [HEADER_BYTES, 64, KEYS.end];
    assert!(refused(&changed(UASTC, levels + 20, 1)).contains("of UASTC have 96 bytes"));
    assert!(refused(&changed(UASTC, 20, 1 << 30)).contains("pixels of UASTC"));
    assert!(refused(&changed(UASTC, levels + 4, u32::MAX)).contains("ends before its mip level 0"));
    assert!(refused(&changed(ETC1S, shared + 4, u32::MAX)).contains("ends before its shared data"));
    assert!(refused(&changed(ETC1S, shared, 376)).contains("shared data"));
    assert!(refused(&changed(ETC1S, 40, 99)).contains("bytes of shared data"));
    assert!(refused(&changed(UASTC, 40, 17)).contains("17 mip levels"));
    // A list of keys that ends beyond the file changes nothing.
    assert!(read(&changed(UASTC, end_of_keys - 4, 1 << 20)).is_ok());
}

#[test]
fn other_textures_name_a_remedy() {
    // R8G8B8A8, an array, a cube map, a volume.
    for (at, word) in [(12, 37), (32, 2), (36, 6), (28, 1)] {
        let error = header_of(&changed(UASTC, at, word)).unwrap_err();
        assert!(error.contains("not read: `gltf-transform ktxdecompress"), "{error}");
    }
}
