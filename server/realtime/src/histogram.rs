//! Distributions of times in fixed memory: recorded by the loop, read by anybody, no lock and no allocation.
use std::sync::atomic::{AtomicU64, Ordering};

/// Each power of two is divided into this many buckets: a value is known to 1/128.
const SUB_BUCKETS: u64 = 128;
const SUB_BITS: u32 = SUB_BUCKETS.ilog2();
/// Values from 2⁴⁰ ns (18 min) share the last bucket; the maximum is exact all the same.
const VALUE_BITS: u32 = 40;
const BUCKETS: usize = ((VALUE_BITS - SUB_BITS + 1) as u64 * SUB_BUCKETS) as usize;

/// Counts of values in ns, in log-linear buckets (as HdrHistogram: exact below 256, to 1 % above).
///
/// Recording is a few relaxed atomic additions. A reader sees each value at some time after it was recorded; the counts it adds
/// up while the loop records may differ by the values recorded meanwhile.
#[derive(Debug)]
pub struct Histogram {
    buckets: Box<[AtomicU64]>,
    count: AtomicU64,
    sum_ns: AtomicU64,
    max_ns: AtomicU64,
}

/// A summary of a [`Histogram`], in ns; each percentile is the upper end of its bucket, never more than `max_ns`.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Percentiles {
    /// Half the values are at most this.
    pub p50_ns: u64,
    /// 99 %.
    pub p99_ns: u64,
    /// 99.9 %.
    pub p999_ns: u64,
    /// The largest, exact.
    pub max_ns: u64,
    /// The mean.
    pub mean_ns: f64,
    /// How many values.
    pub count: u64,
}

impl Default for Histogram {
    fn default() -> Self {
        Self::new()
    }
}

impl Histogram {
    /// Empty; 34 KiB.
    pub fn new() -> Self {
        Self {
            buckets: (0..BUCKETS).map(|_| AtomicU64::new(0)).collect(),
            count: AtomicU64::new(0),
            sum_ns: AtomicU64::new(0),
            max_ns: AtomicU64::new(0),
        }
    }

    /// Counts a value (ns).
    pub fn record(&self, value_ns: u64) {
        self.buckets[bucket_of(value_ns)].fetch_add(1, Ordering::Relaxed);
        self.count.fetch_add(1, Ordering::Relaxed);
        self.sum_ns.fetch_add(value_ns, Ordering::Relaxed);
        self.max_ns.fetch_max(value_ns, Ordering::Relaxed);
    }

    /// Forgets everything, e.g. the warm-up.
    pub fn clear(&self) {
        for bucket in &self.buckets {
            bucket.store(0, Ordering::Relaxed);
        }
        for counter in [&self.count, &self.sum_ns, &self.max_ns] {
            counter.store(0, Ordering::Relaxed);
        }
    }

    /// Adds all that another has counted.
    pub fn add(&self, other: &Self) {
        for (bucket, others) in self.buckets.iter().zip(&other.buckets) {
            bucket.fetch_add(others.load(Ordering::Relaxed), Ordering::Relaxed);
        }
        self.count.fetch_add(other.count.load(Ordering::Relaxed), Ordering::Relaxed);
        self.sum_ns.fetch_add(other.sum_ns.load(Ordering::Relaxed), Ordering::Relaxed);
        self.max_ns.fetch_max(other.max_ns.load(Ordering::Relaxed), Ordering::Relaxed);
    }

    /// How many values.
    pub fn count(&self) -> u64 {
        self.count.load(Ordering::Relaxed)
    }

    /// How many values are at most `value_ns`, to within the bucket that it is in.
    pub fn count_up_to(&self, value_ns: u64) -> u64 {
        self.buckets[..=bucket_of(value_ns)].iter().map(|bucket| bucket.load(Ordering::Relaxed)).sum()
    }

    /// The value (ns) that a share `quantile` (0 to 1) of the values does not exceed; 0 when empty.
    pub fn value_at(&self, quantile: f64) -> u64 {
        let total: u64 = self.buckets.iter().map(|bucket| bucket.load(Ordering::Relaxed)).sum();
        let wanted = ((total as f64 * quantile.clamp(0.0, 1.0)).ceil() as u64).max(1);
        let max_ns = self.max_ns.load(Ordering::Relaxed);
        let mut seen = 0;
        for (index, bucket) in self.buckets.iter().enumerate() {
            seen += bucket.load(Ordering::Relaxed);
            if seen >= wanted {
                return if index == BUCKETS - 1 { max_ns } else { upper_end(index).min(max_ns) };
            }
        }
        max_ns
    }

    /// The summary.
    pub fn percentiles(&self) -> Percentiles {
        let count = self.count();
        let sum_ns = self.sum_ns.load(Ordering::Relaxed);
        Percentiles {
            p50_ns: self.value_at(0.5),
            p99_ns: self.value_at(0.99),
            p999_ns: self.value_at(0.999),
            max_ns: self.max_ns.load(Ordering::Relaxed),
            mean_ns: if count == 0 { 0.0 } else { sum_ns as f64 / count as f64 },
            count,
        }
    }
}

/// A value v with its highest bit at position e ≥ 7 is in bucket `(e − 6)·128 + (v >> (e − 7)) − 128`; smaller ones in bucket v.
fn bucket_of(value: u64) -> usize {
    if value < SUB_BUCKETS {
        return value as usize;
    }
    let exponent = value.ilog2();
    if exponent >= VALUE_BITS {
        return BUCKETS - 1;
    }
    let octave = u64::from(exponent - SUB_BITS + 1);
    (octave * SUB_BUCKETS + (value >> (exponent - SUB_BITS)) - SUB_BUCKETS) as usize
}

/// Largest value of a bucket.
fn upper_end(index: usize) -> u64 {
    let index = index as u64;
    if index < SUB_BUCKETS {
        return index;
    }
    let shift = index / SUB_BUCKETS - 1;
    ((index % SUB_BUCKETS + SUB_BUCKETS + 1) << shift) - 1
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn empty_is_zero() {
        assert_eq!(Histogram::new().percentiles(), Percentiles::default());
    }

    #[test]
    fn small_values_are_exact() {
        let histogram = Histogram::new();
        (1..=100).for_each(|value| histogram.record(value));
        let p = histogram.percentiles();
        assert_eq!((p.p50_ns, p.p99_ns, p.p999_ns, p.max_ns, p.count), (50, 99, 100, 100, 100));
        assert_eq!(p.mean_ns, 50.5);
    }

    #[test]
    fn the_largest_values_keep_their_maximum() {
        let histogram = Histogram::new();
        histogram.record(u64::MAX / 4);
        assert_eq!(histogram.value_at(0.5), u64::MAX / 4);
        histogram.clear();
        assert_eq!(histogram.percentiles(), Percentiles::default());
    }

    #[test]
    fn readable_while_recorded() {
        let histogram = Histogram::new();
        std::thread::scope(|scope| {
            let writer = scope.spawn(|| (0..200_000_u64).for_each(|value| histogram.record(value % 1000)));
            while !writer.is_finished() {
                assert!(histogram.percentiles().p99_ns < 1000);
            }
        });
        assert_eq!(histogram.count(), 200_000);
    }

    proptest! {
        #[test]
        fn every_value_lies_in_its_bucket(value in 0..1_u64 << VALUE_BITS) {
            let index = bucket_of(value);
            prop_assert!(value <= upper_end(index));
            prop_assert!(index == 0 || value > upper_end(index - 1));
            prop_assert!(upper_end(index) - value <= value / SUB_BUCKETS);
        }

        /// HdrHistogram with three digits is the oracle.
        #[test]
        fn agrees_with_hdrhistogram(values in prop::collection::vec(1..10_000_000_u64, 1..500), split in 0..500_usize) {
            let mut oracle = hdrhistogram::Histogram::<u64>::new_with_bounds(1, 1 << VALUE_BITS, 3).unwrap();
            let (first, second) = (Histogram::new(), Histogram::new());
            for (index, value) in values.iter().enumerate() {
                oracle.record(*value).unwrap();
                if index < split { first.record(*value) } else { second.record(*value) }
            }
            first.add(&second);
            prop_assert_eq!(first.count(), oracle.len());
            for quantile in [0.5, 0.9, 0.99, 0.999, 1.0] {
                let (ours, theirs) = (first.value_at(quantile) as f64, oracle.value_at_quantile(quantile) as f64);
                prop_assert!((ours - theirs).abs() <= 0.01 * theirs + 1.0, "{quantile}: {ours} against {theirs}");
            }
        }
    }
}
