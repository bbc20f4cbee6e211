//! Skin-weight transfer by weight inpainting.
