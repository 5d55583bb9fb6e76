//! What is odd about a channel, in words.

use crate::health::Health;

/// Mean of a channel, relative to full scale, from which on it is called an offset (-40 dBFS).
const OFFSET: f64 = 0.01;

impl Health {
    /// What a person should know about a channel: that it is dead, clipped, offset, a copy of another
    /// or not finite in places. Empty for a sound channel, and for one that does not exist.
    pub fn notes(&self, channel: usize) -> Vec<String> {
        let Some(health) = self.channels.get(channel) else { return Vec::new() };
        let mut notes = Vec::new();
        if health.dead && self.frames > 0 {
            notes.push("dead (constant)".to_owned());
        }
        if health.clipped_runs > 0 {
            notes.push(format!("clipped in {}", counted(health.clipped_runs, "place")));
        }
        if health.dc_offset.abs() >= OFFSET {
            notes.push(format!("DC offset {:+.2}", health.dc_offset));
        }
        let first = self.duplicates.iter().find(|(_, second)| *second == channel);
        if let Some((first, _)) = first {
            notes.push(format!("same as channel {first}"));
        }
        if health.non_finite > 0 {
            notes.push(format!("{} not finite", counted(health.non_finite, "sample")));
        }
        notes
    }
}

fn counted(count: u64, what: &str) -> String {
    format!("{count} {what}{}", if count == 1 { "" } else { "s" })
}

#[cfg(test)]
mod tests {
    use crate::HealthMeter;

    #[test]
    fn each_fault_is_named_and_sound_channels_are_not() {
        let mut meter = HealthMeter::new(5, 8000);
        let samples: Vec<f32> = (0..8000)
            .flat_map(|t| {
                let tone = (std::f32::consts::TAU * 100.0 * t as f32 / 8000.0).sin();
                let broken = if t == 7 { f32::NAN } else { 0.1 * tone };
                [0.3 * tone, (2.0 * tone).clamp(-0.9, 0.9), 0.3 * tone, 0.1 * tone + 0.2, broken]
            })
            .collect();
        meter.push(&samples);
        let health = meter.finish();
        assert!(health.notes(0).is_empty() && health.notes(9).is_empty());
        assert_eq!(health.notes(1), ["clipped in 200 places"]);
        assert_eq!(health.notes(2), ["same as channel 0"]);
        assert_eq!(health.notes(3), ["DC offset +0.20"]);
        assert_eq!(health.notes(4), ["1 sample not finite"]);
        let mut silent = HealthMeter::new(1, 8000);
        silent.push(&[0.0; 100]);
        assert_eq!(silent.finish().notes(0), ["dead (constant)"]);
    }
}
