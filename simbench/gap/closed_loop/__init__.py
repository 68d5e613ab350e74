"""What does the simulated loop do, before and after an effect is added?"""
