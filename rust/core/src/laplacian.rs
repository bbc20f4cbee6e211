//! Placeholder until the transfer work lands.
