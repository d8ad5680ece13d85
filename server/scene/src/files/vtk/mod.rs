//! VTK: the legacy format, and the XML formats VTU and VTP.
mod array;
mod attributes;
mod base64;
pub(super) mod cells;
pub(super) mod legacy;
pub(super) mod xml;
