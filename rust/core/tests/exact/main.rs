//! Answers that closed forms, dense systems and searches through everything give too.

#[allow(dead_code)] // what other tests need of it
#[path = "../common/mod.rs"]
mod common;

mod dense;
mod sheet;
mod walls;

mod accuracy;
mod choices;
mod confidence;
mod fill;
mod hanging;
mod islands;
mod matching;
mod near;
mod prepared;
mod screened;
mod sculpt_exact;
mod smoothing;
