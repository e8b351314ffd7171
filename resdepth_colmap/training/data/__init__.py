"""What is trained on: scenes, labelled views, samples, crops."""
