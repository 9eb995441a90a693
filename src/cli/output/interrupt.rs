//! Ctrl-C while frames are followed: the first ends the capture, not the program.

use std::sync::atomic::{AtomicU8, Ordering};

const NO_CAPTURE: u8 = 0;
const FOLLOWED: u8 = 1;
const ENDED: u8 = 2;

static STATE: AtomicU8 = AtomicU8::new(NO_CAPTURE);

/// A capture that is followed, as long as it lives.
pub struct FollowedCapture(());

impl FollowedCapture {
    /// From now on Ctrl-C ends the capture.
    pub fn begin() -> Self {
        STATE.store(FOLLOWED, Ordering::SeqCst);
        Self(())
    }

    /// True if the capture was ended by Ctrl-C.
    pub fn is_ended(&self) -> bool {
        STATE.load(Ordering::SeqCst) == ENDED
    }
}

impl Drop for FollowedCapture {
    fn drop(&mut self) {
        STATE.store(NO_CAPTURE, Ordering::SeqCst);
    }
}

/// Ends the capture that is followed; false if there is none, or it is ended already.
pub fn end_capture() -> bool {
    let ended = STATE.compare_exchange(FOLLOWED, ENDED, Ordering::SeqCst, Ordering::SeqCst);
    ended.is_ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_interruption_ends_the_capture_and_the_second_the_program() {
        assert!(!end_capture());
        let capture = FollowedCapture::begin();
        assert!(!capture.is_ended());
        assert!(end_capture() && capture.is_ended());
        assert!(!end_capture());
        drop(capture);
        assert!(!end_capture());
    }
}
