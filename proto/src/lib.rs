//! The wire types of Palpate, generated from `proto/palpate/v1/*.proto` without protoc.
//!
//! No validation, no conversion: the daemon converts in one place (`server/daemon/src/grpc/convert.rs`). With the feature `connect`,
//! also the way from a daemon's address to a connection, which every client shares.
#[cfg(feature = "connect")]
pub mod connect;

/// `palpate.v1`: messages, clients and servers of `Device`, `Surface` and `Session`.
#[allow(missing_docs, unreachable_pub, unused_qualifications, clippy::all, clippy::pedantic)]
pub mod v1 {
    tonic::include_proto!("palpate.v1");
}

/// The encoded `FileDescriptorSet` of the package, for server reflection and for the web page.
pub const DESCRIPTOR_SET: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/palpate_descriptor.bin"));

/// Version of `Device` that this build speaks. It changes when an older peer would misunderstand a newer one, or lack what keeps an arm
/// safe; fields that may be left out change nothing.
pub const PROTOCOL_VERSION: u32 = 1;

/// Largest snapshot that is sent and may be restored (bytes): some 600 000 nodes. Clients have to raise tonic's limit of 4 MiB to it.
pub const MAX_SNAPSHOT_BYTES: usize = 64 * 1024 * 1024;

/// What an arm's connection may begin with, before TLS and HTTP/2, to be served by the daemon's thread for arms. No other protocol
/// of the port begins with its first byte.
pub const ARM_SIGN: &[u8; 16] = b"\xA7palpate-arm/1\r\n";

#[cfg(test)]
mod tests {
    use prost::Message;

    #[test]
    fn descriptor_set_names_the_three_services() {
        let set = String::from_utf8_lossy(super::DESCRIPTOR_SET);
        for service in ["Device", "Surface", "Session"] {
            assert!(set.contains(service), "{service} is missing from the descriptor set");
        }
    }

    #[test]
    fn a_sample_survives_the_wire() {
        let sample = super::v1::DeviceSample { sequence: 7, device_time_ns: 11, buttons: 3, ..Default::default() };
        let bytes = sample.encode_to_vec();
        assert_eq!(super::v1::DeviceSample::decode(bytes.as_slice()).unwrap(), sample);
    }
}
