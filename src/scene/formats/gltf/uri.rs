//! URIs of buffers and images: files beside the glTF file, or data within it.

use base64::{
    Engine,
    alphabet::STANDARD,
    engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig},
};
use percent_encoding::{percent_decode, percent_decode_str};

use crate::scene::model::error::Checked;

/// Base64 with or without padding, since some exporters leave it out.
const BASE64: GeneralPurpose = GeneralPurpose::new(
    &STANDARD,
    GeneralPurposeConfig::new()
        .with_decode_padding_mode(DecodePaddingMode::Indifferent)
        .with_decode_allow_trailing_bits(true),
);

/// What a URI stands for.
pub(super) enum Uri {
    /// The data that the URI itself holds, which [`data`] decodes.
    Data,
    /// The name of a file, decoded.
    File(String),
}

impl Uri {
    /// Decodes the name in a URI.
    pub fn new(uri: &str) -> Checked<Self> {
        if is_data(uri) {
            return Ok(Self::Data);
        }
        let name = percent_decode_str(uri).decode_utf8().map_err(|_| format!("the name `{uri}` is not UTF-8"))?;
        match scheme(&name) {
            Some(scheme) => Err(format!("`{name}` is not a relative path: files with `{scheme}:` are not read")),
            None => Ok(Self::File(name.into_owned())),
        }
    }
}

/// Returns whether a URI holds data.
pub(super) fn is_data(uri: &str) -> bool {
    uri.get(..5).is_some_and(|scheme| scheme.eq_ignore_ascii_case("data:"))
}

/// Returns the scheme of a URI, or the letter of a drive.
fn scheme(name: &str) -> Option<&str> {
    let (scheme, _) = name.split_once(':')?;
    let is_scheme = scheme.starts_with(|c: char| c.is_ascii_alphabetic())
        && scheme.chars().all(|c| c.is_ascii_alphanumeric() || "+-.".contains(c));
    is_scheme.then_some(scheme)
}

/// Returns the data that a URI holds.
pub(super) fn data(uri: &str) -> Checked<Vec<u8>> {
    let (kind, data) = uri.split_once(',').ok_or("a data URI lacks its comma")?;
    let data: Vec<u8> = percent_decode(data.as_bytes()).collect();
    if kind.to_ascii_lowercase().ends_with(";base64") {
        BASE64.decode(data).map_err(|error| format!("a data URI is not base64: {error}"))
    } else {
        Ok(data)
    }
}
