"""What accuracy costs: scenes rendered at many qualities, timed, compared, chosen."""
