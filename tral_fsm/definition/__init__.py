"""What a machine file may say."""
