//! The descriptor of a panorama, computed beside the robot's loop. A result is taken when the next panorama comes, so
//! that a simulated run repeats exactly.

use fht_robot::descriptor::{Appearance, DescriptorNet};
use fht_robot::frame::Panorama;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};

/// A thread that describes panoramas, one at a time.
pub struct CameraWorker<C> {
    panoramas: SyncSender<Panorama>,
    appearances: Receiver<Result<Appearance, String>>,
    /// What belongs to the panorama under way.
    context: Option<C>,
}

impl<C> CameraWorker<C> {
    /// Starts the thread.
    ///
    /// # Errors
    /// When the system gives no thread.
    pub fn start(mut net: DescriptorNet) -> std::io::Result<Self> {
        let (panoramas, incoming) = sync_channel::<Panorama>(1);
        let (outgoing, appearances) = sync_channel(1);
        std::thread::Builder::new().name("camera".to_owned()).spawn(move || {
            for panorama in incoming {
                let appearance = net.appearance(&panorama).map_err(|error| error.to_string());
                if outgoing.send(appearance).is_err() {
                    return;
                }
            }
        })?;
        Ok(Self { panoramas, appearances, context: None })
    }

    /// Hands a panorama over, with what belongs to it; returns the previous one's result, waiting for it if need be.
    pub fn exchange(&mut self, panorama: Panorama, context: C) -> Option<(C, Appearance)> {
        let finished = self.finish();
        if self.panoramas.send(panorama).is_ok() {
            self.context = Some(context);
        }
        finished
    }

    /// The result of the panorama under way, waiting for it.
    pub fn finish(&mut self) -> Option<(C, Appearance)> {
        let context = self.context.take()?;
        match self.appearances.recv() {
            Ok(Ok(appearance)) => Some((context, appearance)),
            Ok(Err(error)) => {
                tracing::warn!("a panorama was not described: {error}");
                None
            }
            Err(_) => None,
        }
    }
}
