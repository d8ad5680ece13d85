//! `Session.Detach`: which device is meant, and when it has gone.
use crate::session::{ActiveSession, DeviceRecord};
use std::{sync::Arc, time::Duration};
use tokio::time::timeout;
use tonic::Status;

/// How long the force may take to go, and the stream to end.
const GONE_WITHIN: Duration = Duration::from_secs(5);

/// The tool of this name, or the only one that a device drives, and that device.
///
/// # Errors
/// `NOT_FOUND` without such a tool; `FAILED_PRECONDITION` when no device drives it, or several might be meant.
pub fn driven<'a>(session: &'a ActiveSession, tool_name: &str) -> Result<(&'a str, Arc<DeviceRecord>), Status> {
    let driven: Vec<(&str, Arc<DeviceRecord>)> =
        session.tools.iter().filter_map(|tool| Some((tool.name.as_str(), tool.device()?))).collect();
    let of = |devices: &[(&str, Arc<DeviceRecord>)]| {
        let each: Vec<String> =
            devices.iter().map(|(tool, device)| format!("\"{tool}\" by device \"{}\"", device.name)).collect();
        if each.is_empty() { "no device drives a tool".to_owned() } else { format!("driven are {}", each.join(", ")) }
    };
    if !tool_name.is_empty() {
        let Some(tool) = session.tools.iter().find(|tool| tool.name == tool_name) else {
            let shown: String = tool_name.chars().take(64).flat_map(char::escape_debug).collect();
            return Err(Status::not_found(format!("there is no tool \"{shown}\"; {}", of(&driven))));
        };
        let found = driven.iter().find(|(name, _)| *name == tool.name).cloned();
        let text = || Status::failed_precondition(format!("no device drives tool \"{}\"; {}", tool.name, of(&driven)));
        return found.ok_or_else(text);
    }
    match &driven[..] {
        [only] => Ok(only.clone()),
        [] => Err(Status::failed_precondition(of(&driven))),
        _ => Err(Status::failed_precondition(format!("say which tool: {}", of(&driven)))),
    }
}

/// Waits until a device that loses its tool has gone.
///
/// # Errors
/// `DEADLINE_EXCEEDED`, when its stream does not end in time.
pub async fn until_gone(device: &DeviceRecord) -> Result<(), Status> {
    timeout(GONE_WITHIN, device.gone()).await.map_err(|_| {
        Status::deadline_exceeded(format!(
            "the force on device \"{}\" is ramped to zero, but its stream has not ended within {} s",
            device.name,
            GONE_WITHIN.as_secs()
        ))
    })
}
