"""Training: the tensors of a shape, the LightningModule, the loss, checkpoints and exports."""
