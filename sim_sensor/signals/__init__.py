"""Raw signals of tactile fingers: strains, depth images, and what spoils them."""
