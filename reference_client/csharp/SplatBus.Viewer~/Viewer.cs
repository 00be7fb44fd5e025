// SPDX-License-Identifier: MIT
using System;
using System.Globalization;

namespace SplatBus.Viewer
{
    /// <summary>
    /// A viewer without a window: sways the camera, looks at the pixel in the middle of each image, and
    /// says what happens. Where to connect stands in the environment, `SPLATBUS_HOST` and so on.
    /// </summary>
    static class Viewer
    {
        static readonly TimeSpan Refresh = TimeSpan.FromMilliseconds(50);

        static void Main()
        {
            CultureInfo.DefaultThreadCurrentCulture = CultureInfo.CurrentCulture = CultureInfo.InvariantCulture;
            using (var client = new SplatBusClient(ClientOptions.FromEnvironment()))
            {
                for (int refresh = 0; ; refresh++)
                {
                    Pose pose = Pose.Identity;
                    pose.X = 0.1 * Math.Sin(0.1 * refresh);
                    pose.Z = -4;
                    client.SendCamera(pose);
                    using (FrameLease lease = client.TakeFrame(Refresh)) if (lease.IsThere) Look(lease);
                    ClientEvent told;
                    while (client.TryTakeEvent(out told)) Console.WriteLine(told);
                }
            }
        }

        static void Look(FrameLease lease)
        {
            Meta meta = lease.Packet.Meta;
            long middle = meta.H / 2 * meta.W + meta.W / 2;
            float depth = lease.Depth[(int)middle];
            ReadOnlySpan<float> color = lease.Color.Slice((int)(4 * middle), 4);
            Console.WriteLine("image {0}: {1:g3} {2:g3} {3:g3} in the middle, at depth {4:g3}", lease.Frame.Seq, color[0], color[1], color[2], depth);
        }
    }
}
