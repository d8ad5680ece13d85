//! Functions of time, checked.
use super::{Files, check, csv, exactly_one};
use crate::{
    document::{
        motion::{AmplitudeTable, PointsTable, TransitionTable},
        source::{Fault, Where},
    },
    timeline::{Amplitude, Transition},
};

/// The factor a table describes.
pub(crate) fn compile(table: &AmplitudeTable, at: &Where, files: &Files<'_>) -> Result<Amplitude, Fault> {
    let AmplitudeTable { constant, ramp, smooth_step, sine, pulse, table: points } = table;
    exactly_one(
        at,
        &[
            ("constant", constant.is_some()),
            ("ramp", ramp.is_some()),
            ("smooth_step", smooth_step.is_some()),
            ("sine", sine.is_some()),
            ("pulse", pulse.is_some()),
            ("table", points.is_some()),
        ],
    )?;
    if let Some(ramp) = ramp {
        return Ok(Amplitude::Ramp(transition(ramp, &at.key("ramp"))?));
    }
    if let Some(step) = smooth_step {
        return Ok(Amplitude::SmoothStep(transition(step, &at.key("smooth_step"))?));
    }
    if let Some(sine) = sine {
        let frequency = sine.frequency_hz;
        check(&at.key("sine").key("frequency_hz"), frequency, frequency > 0.0, "must be larger than 0")?;
        return Ok(Amplitude::Sine {
            mean: sine.mean,
            amplitude: sine.amplitude,
            frequency_hz: frequency,
            phase_rad: sine.phase_rad,
            start_s: sine.start_s,
        });
    }
    if let Some(pulse) = pulse {
        let at = at.key("pulse");
        let duration = pulse.duration_s;
        check(&at.key("duration_s"), duration, duration > 0.0, "must be larger than 0")?;
        if let Some(period) = pulse.period_s {
            check(&at.key("period_s"), period, period > duration, "must be longer than the pulse's duration_s")?;
        }
        let (value, start_s, period_s) = (pulse.value, pulse.start_s, pulse.period_s);
        return Ok(Amplitude::Pulse { value, start_s, duration_s: duration, period_s });
    }
    match points {
        Some(points) => table_of(points, &at.key("table"), files),
        None => Ok(Amplitude::Constant(constant.unwrap_or_default())),
    }
}

fn transition(table: &TransitionTable, at: &Where) -> Result<Transition, Fault> {
    let duration = table.duration_s;
    check(&at.key("duration_s"), duration, duration > 0.0, "must be larger than 0")?;
    Ok(Transition { from: table.from, to: table.to, start_s: table.start_s, duration_s: duration })
}

fn table_of(points: &PointsTable, at: &Where, files: &Files<'_>) -> Result<Amplitude, Fault> {
    let (times_s, values): (Vec<f64>, Vec<f64>) = match points {
        PointsTable { times_s: Some(times), values: Some(values), file: None } => {
            if times.len() != values.len() {
                let message = format!("{at} has {} times_s but {} values", times.len(), values.len());
                return Err(Fault::value(at.key("values"), message));
            }
            (times.clone(), values.clone())
        }
        PointsTable { times_s: None, values: None, file: Some(file) } => {
            let at = at.key("file");
            let path = files.resolve(&at, file)?;
            let rows = csv::read(&path, files.limits, [csv::TIME, csv::number("value")])
                .map_err(|error| Fault::value(at.clone(), error.to_string()).cause(error))?;
            rows.into_iter().map(|[time, value]| (time, value)).unzip()
        }
        _ => return Err(Fault::value(at.clone(), format!("{at} needs either times_s and values, or file"))),
    };
    if times_s.is_empty() {
        return Err(Fault::value(at.clone(), format!("{at} has no point")));
    }
    if let Some(index) = (1..times_s.len()).find(|&index| times_s[index] <= times_s[index - 1]) {
        let message = format!("{at}: times must increase, but {} s follows {} s", times_s[index], times_s[index - 1]);
        return Err(Fault::value(at.key("times_s").index(index), message));
    }
    Ok(Amplitude::Table { times_s, values })
}
