//! `/metrics`: what an operator's Prometheus asks for, in OpenMetrics text, read from the counters that are there anyway.
use crate::{session::Daemon, sim::timing::STAGES};
use axum::{
    body::Body,
    http::{Response, StatusCode, header},
};
use palpate_realtime::{Clock, Histogram};
use prometheus_client::{
    collector::Collector,
    encoding::{DescriptorEncoder, EncodeMetric as _, text::encode},
    metrics::{MetricType, counter::ConstCounter, gauge::ConstGauge},
    registry::{Registry, Unit},
};
use std::{
    fmt,
    sync::{Arc, atomic::Ordering},
};

/// Where it is asked for.
pub const PATH: &str = "/metrics";

/// The answer to whoever may ask.
pub fn serve(daemon: &Arc<Daemon>) -> Response<Body> {
    let mut registry = Registry::with_prefix("palpate");
    registry.register_collector(Box::new(Read(Arc::clone(daemon))));
    let mut text = String::new();
    // Writing to memory does not fail.
    let status = match encode(&mut text, &registry) {
        Ok(()) => StatusCode::OK,
        Err(_) => StatusCode::INTERNAL_SERVER_ERROR,
    };
    let mut response = Response::new(Body::from(text));
    *response.status_mut() = status;
    let kind = "application/openmetrics-text; version=1.0.0; charset=utf-8";
    response.headers_mut().insert(header::CONTENT_TYPE, header::HeaderValue::from_static(kind));
    response
}

/// Reads the daemon when it is asked.
#[derive(Debug)]
struct Read(Arc<Daemon>);

/// Labels of one value, name and value each.
type Labels<'a> = Vec<(&'a str, String)>;

/// One metric, with a value for each set of labels.
struct Metric<'a> {
    name: &'a str,
    help: &'a str,
    unit: Option<Unit>,
}

const fn metric<'a>(name: &'a str, help: &'a str) -> Metric<'a> {
    Metric { name, help, unit: None }
}

impl Metric<'_> {
    fn seconds(self) -> Self {
        Self { unit: Some(Unit::Seconds), ..self }
    }

    fn gauges(&self, encoder: &mut DescriptorEncoder<'_>, values: &[(Labels<'_>, f64)]) -> fmt::Result {
        let mut family = encoder.encode_descriptor(self.name, self.help, self.unit.as_ref(), MetricType::Gauge)?;
        for (labels, value) in values {
            ConstGauge::new(*value).encode(family.encode_family(labels)?)?;
        }
        Ok(())
    }

    fn gauge(&self, encoder: &mut DescriptorEncoder<'_>, value: f64) -> fmt::Result {
        let one = encoder.encode_descriptor(self.name, self.help, self.unit.as_ref(), MetricType::Gauge)?;
        ConstGauge::new(value).encode(one)
    }

    fn counters(&self, encoder: &mut DescriptorEncoder<'_>, values: &[(Labels<'_>, u64)]) -> fmt::Result {
        let mut family = encoder.encode_descriptor(self.name, self.help, self.unit.as_ref(), MetricType::Counter)?;
        for (labels, value) in values {
            ConstCounter::new(*value).encode(family.encode_family(labels)?)?;
        }
        Ok(())
    }

    fn counter(&self, encoder: &mut DescriptorEncoder<'_>, value: u64) -> fmt::Result {
        let one = encoder.encode_descriptor(self.name, self.help, self.unit.as_ref(), MetricType::Counter)?;
        ConstCounter::new(value).encode(one)
    }
}

/// Quantiles of a distribution (s), each under its own label.
fn quantiles<'a>(stage: Option<&str>, histogram: &Histogram) -> Vec<(Labels<'a>, f64)> {
    let p = histogram.percentiles();
    let of = [("0.5", p.p50_ns), ("0.99", p.p99_ns), ("0.999", p.p999_ns), ("1", p.max_ns)];
    let labelled = |(quantile, ns): (&str, u64)| {
        let stage = stage.map(|stage| ("stage", stage.to_owned()));
        (stage.into_iter().chain([("quantile", quantile.to_owned())]).collect(), ns as f64 * 1e-9)
    };
    of.into_iter().map(labelled).collect()
}

impl Collector for Read {
    fn encode(&self, mut encoder: DescriptorEncoder<'_>) -> fmt::Result {
        let encoder = &mut encoder;
        self.of_the_loop(encoder)?;
        self.of_devices(encoder)?;
        self.of_others(encoder)
    }
}

impl Read {
    fn of_the_loop(&self, encoder: &mut DescriptorEncoder<'_>) -> fmt::Result {
        let timing = &self.0.timing;
        let counters = [
            (metric("ticks", "Times the loop woke for a tick"), timing.the_loop.ticks()),
            (metric("overruns", "Ticks that ended after the next was due"), timing.the_loop.overruns()),
            (metric("skipped_ticks", "Ticks that were never run"), timing.the_loop.skipped()),
            (metric("repeated_ticks", "Ticks that proved unstable and were repeated"), timing.repeated_ticks()),
            (metric("inputs_rejected", "Inputs that the physics refused"), timing.inputs_rejected()),
        ];
        for (counter, value) in counters {
            counter.counter(encoder, value)?;
        }
        metric("quarantined", "1 while the body's state is quarantined and arms get no force")
            .gauge(encoder, f64::from(u8::from(timing.quarantined_at().is_some())))?;
        metric("wakeup_lateness", "How late the loop wakes")
            .seconds()
            .gauges(encoder, &quantiles(None, &timing.the_loop.wakeup_lateness))?;
        metric("tick_cost", "What a tick costs").seconds().gauges(encoder, &quantiles(None, &timing.tick))?;
        let stages = STAGES.iter().zip(&timing.stages).flat_map(|(stage, cost)| quantiles(Some(stage), cost));
        metric("stage_cost", "What the stages of a tick cost").seconds().gauges(encoder, &stages.collect::<Vec<_>>())
    }

    fn of_devices(&self, encoder: &mut DescriptorEncoder<'_>) -> fmt::Result {
        let session = self.0.session();
        let now_ns = Clock::Monotonic.now_ns();
        let attached: Vec<_> = session
            .tools
            .iter()
            .filter_map(|tool| {
                let device = tool.device()?;
                let labels = vec![("device", device.name.clone()), ("tool", tool.name.clone())];
                Some((labels, device))
            })
            .collect();
        let gauges = |of: &dyn Fn(&crate::session::DeviceRecord) -> f64| {
            attached.iter().map(|(labels, device)| (labels.clone(), of(device))).collect::<Vec<_>>()
        };
        let samples: Vec<_> =
            attached.iter().map(|(labels, device)| (labels.clone(), device.accepted.load(Ordering::Relaxed))).collect();
        metric("device_samples", "Samples taken from a device").counters(encoder, &samples)?;
        metric("device_force_newtons", "Magnitude of the last force sent to a device")
            .gauges(encoder, &gauges(&|device| device.force_n()))?;
        let age_s = |device: &crate::session::DeviceRecord| match device.newest_ns.load(Ordering::Relaxed) {
            0 => 0.0,
            newest_ns => now_ns.saturating_sub(newest_ns) as f64 * 1e-9,
        };
        metric("device_sample_age", "Age of a device's newest sample").seconds().gauges(encoder, &gauges(&age_s))?;
        metric("samples_rejected", "Samples dropped over all devices")
            .counter(encoder, self.0.samples_rejected.load(Ordering::Relaxed))
    }

    fn of_others(&self, encoder: &mut DescriptorEncoder<'_>) -> fmt::Result {
        metric("viewers", "Viewers that watch now").gauge(encoder, f64::from(self.0.hub.viewer_count()))?;
        metric("frames_skipped", "Updates dropped over all viewers").counter(encoder, self.0.hub.frames_skipped())?;
        let refusals: Vec<_> = self
            .0
            .refusals
            .all()
            .into_iter()
            .map(|(reason, count)| (vec![("reason", reason.to_owned())], count))
            .collect();
        metric("refusals", "Connections and requests that were refused").counters(encoder, &refusals)?;
        if let Some(bytes) = resident_bytes() {
            metric("resident_memory_bytes", "Memory of the process").gauge(encoder, bytes as f64)?;
        }
        if let Some(autosave) = &self.0.autosave {
            metric("autosave_age", "Age of the newest autosave; before the first, time since the start")
                .seconds()
                .gauge(encoder, autosave.unsaved_s())?;
        }
        let version = vec![("version", env!("CARGO_PKG_VERSION").to_owned())];
        metric("build", "1; the label says which version runs").gauges(encoder, &[(version, 1.0)])
    }
}

/// Resident memory of this process, where the system tells.
fn resident_bytes() -> Option<u64> {
    let text = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = text.lines().find_map(|line| line.strip_prefix("VmRSS:"))?;
    let kilobytes: u64 = line.split_whitespace().next()?.parse().ok()?;
    Some(1024 * kilobytes)
}
