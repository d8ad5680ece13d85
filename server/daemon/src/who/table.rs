//! Calls by role. What is not in the table is denied; a test holds it against the descriptor, so that none is forgotten.
use super::role::{Role, Roles};
use crate::metrics;

/// Who may make a call.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Who {
    /// Whoever reaches the daemon: service managers ask for its health.
    Anybody,
    /// Identities with one of these roles.
    With(Roles),
}

const EVERY_ROLE: Who = Who::With(Roles::ALL);
const OPERATORS: Who = Who::With(Roles::of(&[Role::Operator]));
const WATCHERS: Who = Who::With(Roles::of(&[Role::Viewer, Role::Injector, Role::Operator]));
const INJECTORS: Who = Who::With(Roles::of(&[Role::Injector, Role::Operator]));
const DEVICES: Who = Who::With(Roles::of(&[Role::Device]));

/// Every call, and who may make it.
pub const TABLE: [(&str, Who); 17] = [
    ("/palpate.v1.Device/Attach", DEVICES),
    ("/palpate.v1.Surface/Watch", WATCHERS),
    ("/palpate.v1.Session/List", EVERY_ROLE),
    ("/palpate.v1.Session/Status", EVERY_ROLE),
    ("/palpate.v1.Session/LoadScene", OPERATORS),
    ("/palpate.v1.Session/Reset", OPERATORS),
    ("/palpate.v1.Session/Detach", OPERATORS),
    ("/palpate.v1.Session/Pause", OPERATORS),
    ("/palpate.v1.Session/Step", OPERATORS),
    ("/palpate.v1.Session/Snapshot", OPERATORS),
    ("/palpate.v1.Session/Restore", OPERATORS),
    ("/palpate.v1.Session/InjectForces", INJECTORS),
    (metrics::PATH, WATCHERS),
    ("/grpc.health.v1.Health/Check", Who::Anybody),
    ("/grpc.health.v1.Health/Watch", EVERY_ROLE),
    ("/grpc.reflection.v1.ServerReflection/ServerReflectionInfo", EVERY_ROLE),
    ("/grpc.reflection.v1alpha.ServerReflection/ServerReflectionInfo", EVERY_ROLE),
];

/// Who may make a call, by its path; nobody, if it is not in the table.
pub fn who_may(path: &str) -> Who {
    TABLE.iter().find(|(known, _)| *known == path).map_or(Who::With(Roles::NONE), |(_, who)| *who)
}

impl Who {
    /// Whether these roles are enough.
    pub const fn includes(self, roles: Roles) -> bool {
        match self {
            Self::Anybody => true,
            Self::With(allowed) => !allowed.and(roles).is_empty(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use prost::Message as _;
    use std::collections::BTreeSet;

    /// Paths of all methods of a descriptor set.
    fn methods(set: &[u8]) -> BTreeSet<String> {
        let set = prost_types::FileDescriptorSet::decode(set).unwrap();
        let of_file = |file: prost_types::FileDescriptorProto| {
            let package = file.package().to_owned();
            file.service.into_iter().flat_map(move |service| {
                let service_name = format!("/{package}.{}", service.name());
                service.method.into_iter().map(move |method| format!("{service_name}/{}", method.name()))
            })
        };
        set.file.into_iter().flat_map(of_file).collect()
    }

    #[test]
    fn every_call_is_in_the_table_once() {
        let known: BTreeSet<String> = TABLE.iter().map(|(path, _)| (*path).to_owned()).collect();
        assert_eq!(known.len(), TABLE.len());
        let sets = [
            palpate_proto::DESCRIPTOR_SET,
            tonic_health::pb::FILE_DESCRIPTOR_SET,
            tonic_reflection::pb::v1::FILE_DESCRIPTOR_SET,
            tonic_reflection::pb::v1alpha::FILE_DESCRIPTOR_SET,
        ];
        let all: BTreeSet<String> = sets.into_iter().flat_map(methods).chain([metrics::PATH.to_owned()]).collect();
        assert_eq!(known, all);
    }

    #[test]
    fn what_is_not_in_the_table_is_denied() {
        for path in ["/palpate.v1.Session/Shutdown", "/palpate.v1.session/Pause", "", "/"] {
            assert!(!who_may(path).includes(Roles::ALL), "{path}");
        }
        assert!(!who_may("/palpate.v1.Session/Status").includes(Roles::NONE));
        assert!(!who_may("/palpate.v1.Device/Attach").includes(Roles::of(&[Role::Operator])));
    }
}
