//! The newest value from one thread to another. Wait-free on both sides; a value nobody took is overwritten and counted.
use std::sync::{
    Arc,
    atomic::{AtomicU64, Ordering},
};
use triple_buffer::{Input, Output, TripleBuffer};

/// A slot that starts with three copies of `initial`, and holds nothing new until the first publication.
pub fn slot<T: Clone + Send>(initial: &T) -> (SlotWriter<T>, SlotReader<T>) {
    let (input, output) = TripleBuffer::new(initial).split();
    let counts = Arc::new(Counts::default());
    (SlotWriter { input, counts: Arc::clone(&counts) }, SlotReader { output, counts })
}

#[derive(Debug, Default)]
struct Counts {
    published: AtomicU64,
    overwritten: AtomicU64,
}

/// The writing side.
#[derive(Debug)]
pub struct SlotWriter<T: Send> {
    input: Input<T>,
    counts: Arc<Counts>,
}

impl<T: Send> SlotWriter<T> {
    /// Publishes a value.
    pub fn publish(&mut self, value: T) {
        *self.input.input_buffer_mut() = value;
        self.publish_buffer();
    }

    /// The buffer to fill in place before [`SlotWriter::publish_buffer`]. It holds some earlier value: overwrite all of it.
    pub fn buffer(&mut self) -> &mut T {
        self.input.input_buffer_mut()
    }

    /// Publishes the buffer.
    pub fn publish_buffer(&mut self) {
        let overwrote = self.input.publish();
        self.counts.published.fetch_add(1, Ordering::Relaxed);
        if overwrote {
            self.counts.overwritten.fetch_add(1, Ordering::Relaxed);
        }
    }

    /// Whether the reader has taken the last value published.
    pub fn is_taken(&self) -> bool {
        self.input.consumed()
    }

    /// Values published.
    pub fn published(&self) -> u64 {
        self.counts.published.load(Ordering::Relaxed)
    }

    /// Values overwritten before anybody took them.
    pub fn overwritten(&self) -> u64 {
        self.counts.overwritten.load(Ordering::Relaxed)
    }
}

/// The reading side.
#[derive(Debug)]
pub struct SlotReader<T: Send> {
    output: Output<T>,
    counts: Arc<Counts>,
}

impl<T: Send> SlotReader<T> {
    /// The newest value, if one was published since the last call.
    pub fn take(&mut self) -> Option<&T> {
        if self.output.update() { Some(self.output.output_buffer()) } else { None }
    }

    /// The newest value, taken before or not; the initial one before any publication.
    pub fn newest(&mut self) -> &T {
        self.output.read()
    }

    /// Values published.
    pub fn published(&self) -> u64 {
        self.counts.published.load(Ordering::Relaxed)
    }

    /// Values overwritten before this side took them.
    pub fn overwritten(&self) -> u64 {
        self.counts.overwritten.load(Ordering::Relaxed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_newest_wins_and_the_rest_is_counted() {
        let (mut writer, mut reader) = slot(&0);
        assert_eq!(reader.take(), None);
        assert_eq!(*reader.newest(), 0);
        for value in 1..=5 {
            writer.publish(value);
        }
        assert!(!writer.is_taken());
        assert_eq!(reader.take(), Some(&5));
        assert_eq!(reader.take(), None);
        assert_eq!(*reader.newest(), 5);
        assert!(writer.is_taken());
        writer.publish(6);
        assert_eq!(reader.take(), Some(&6));
        assert_eq!((reader.published(), writer.overwritten()), (6, 4));
    }

    #[test]
    fn a_value_is_never_torn_nor_older_than_the_last() {
        // Two threads, values of 64 equal words.
        let (mut writer, mut reader) = slot(&[0_u64; 64]);
        let last = 200_000_u64;
        let writing = std::thread::spawn(move || {
            for n in 1..=last {
                writer.buffer().fill(n);
                writer.publish_buffer();
            }
            writer
        });
        let (mut newest, mut taken) = (0, 0);
        while newest < last {
            if let Some(value) = reader.take() {
                assert!(value.iter().all(|word| *word == value[0]), "torn: {value:?}");
                assert!(value[0] > newest);
                newest = value[0];
                taken += 1;
            }
        }
        let writer = writing.join().unwrap();
        assert_eq!(writer.published(), last);
        assert_eq!(writer.overwritten() + taken, last, "every value is taken or counted as overwritten");
    }
}
