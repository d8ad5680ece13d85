//! VTK: the legacy format and the XML formats VTU and VTP.
pub(super) mod legacy;
pub(super) mod xml;
